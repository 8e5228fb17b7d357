"""The picture of a drive: from above, with walls, what else is on the floor, and the path."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from snr_sim.recording.records import Record, TruthRecord
from snr_sim.view import picture
from snr_sim.view.picture_layout import PATH
from snr_sim.view.picture_sheet import PIXELS_PER_POINT
from tests.view.test_picture import header

matplotlib = pytest.importorskip("matplotlib")
image_module = pytest.importorskip("PIL.Image")

WALL, STONE, BODY = (200, 40, 40), (40, 200, 40), (230, 230, 40)
CORNERS = [[x, y, z] for x, y in ((-2, -1), (4, -1), (4, 3), (-2, 3)) for z in (0.0, 0.3)]
SCENE = {
    "statics": {
        "floor": {
            "kind": "box",
            "half_size_m": [3.0, 2.0, 0.01],
            "center_m": [1.0, 1.0, -0.02],
            "rgb": [200, 200, 200],
        },
        "wall": {
            "kind": "mesh",
            "vertices_m": CORNERS,
            "triangles": [[i, (i + 2) % 8, i + 1] for i in range(0, 8, 2)],
            "rgb": list(WALL),
        },
    },
    "bodies": {
        "truck": [{"kind": "box", "half_size_m": [0.3, 0.1, 0.1], "center_m": [0.0, 0.0, 0.1], "rgb": list(BODY)}],
        "stone": [{"kind": "box", "half_size_m": [0.1, 0.1, 0.1], "center_m": [0.0, 0.0, 0.1], "rgb": list(STONE)}],
    },
}


def drive() -> list[Record]:
    """Ten seconds to the east, then five to the north, while a stone is taken from (0, 2) to (1, 2)."""
    records: list[Record] = []
    for k in range(61):
        t = 0.25 * k
        x, y, turn = (0.3 * t, 0.0, 0.0) if t < 10.0 else (3.0, 0.3 * (t - 10.0), 0.5 * math.pi)
        poses = {
            "truck": [x, y, 0.0, 0.0, 0.0, math.sin(turn / 2), math.cos(turn / 2)],
            "stone": [t / 15.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        }
        records.append(TruthRecord(len(records) + 1, t, poses, {}, {"way_m": 0.3 * t}))
    return records


def drawn(tmp_path: Path, records: list[Record], **scene: Any) -> Any:
    path = tmp_path / "run.png"
    picture.draw_run(header(scene=SCENE | scene, scenario="yard"), records, path, "done", metrics={"way_m": 4.5})
    return np.asarray(image_module.open(path).convert("RGB")).astype(int)


def places(image: Any, rgb: tuple[int, int, int], near: int = 40) -> Any:
    """Return rows and columns of pixels of about a color, in the scene's part of the picture, shape (n, 2)."""
    part = image[:, : int(600 * PIXELS_PER_POINT)]
    return np.argwhere(np.abs(part - rgb).sum(axis=2) < near)


def test_drive_is_a_map_with_north_up(tmp_path: Path) -> None:
    image = drawn(tmp_path, drive())
    wall, path, stone = places(image, WALL), places(image, PATH), places(image, STONE, 160)
    assert len(wall) > 0
    (top, left), (bottom, right) = wall.min(axis=0), wall.max(axis=0)
    per_m = (right - left) / 6.0
    assert (bottom - top) / per_m == pytest.approx(4.0, rel=0.02)
    row, column = (stone.min(axis=0) + stone.max(axis=0)) / 2
    assert ((column - left) / per_m - 2.0, (bottom - row) / per_m - 1.0) == pytest.approx((1.0, 2.0), abs=0.05)
    rows, columns = path.T
    assert (bottom - rows.max()) / per_m - 1.0 == pytest.approx(0.0, abs=0.05)
    assert (columns.max() - left) / per_m - 2.0 == pytest.approx(3.0, abs=0.05)


def test_vehicle_is_turned_with_its_heading(tmp_path: Path) -> None:
    """The last one faces north, so it is higher than wide."""
    image = drawn(tmp_path, drive()[-2:])
    found = places(image, BODY, 120)
    high, wide = np.ptp(found, axis=0)
    assert high / wide == pytest.approx((0.6 + 0.075) / 0.2, rel=0.1)


def test_vehicle_that_stands_is_drawn_in_its_room(tmp_path: Path) -> None:
    image = drawn(tmp_path, drive()[:1])
    assert len(places(image, WALL)) > 0
    assert len(places(image, BODY, 120)) > 0


def test_drive_writes_what_was_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []
    write = picture.Sheet.text
    monkeypatch.setattr(
        picture.Sheet, "text", lambda self, at, text, *a, **o: texts.append(text) or write(self, at, text, *a, **o)
    )
    drawn(tmp_path, drive())
    assert {"done, 15.0 s", "way 4.50 m", "0 s", "15 s"} <= set(texts)


# -- on ground --------------------------------------------------------------------------------------------------------

WHEEL = (40, 40, 230)
GROUND = {
    "kind": "mesh",
    "vertices_m": [[x, y, 0.0] for x in (-9.0, 9.0) for y in (-9.0, 9.0)],
    "triangles": [[0, 2, 1], [1, 2, 3]],
    "rgb": [120, 120, 120],
}
ON_GROUND = {
    "statics": {"ground": GROUND},
    "bodies": {
        "truck": SCENE["bodies"]["truck"],
        "wheel": [{"kind": "box", "half_size_m": [0.06, 0.06, 0.06], "center_m": [0.0, 0.0, 0.1], "rgb": list(WHEEL)}],
    },
}


def driven(rise: float, north: float) -> list[Record]:
    """Six meters to the east with a wheel on its right, and a share of that up and to the north."""
    records: list[Record] = []
    for k in range(31):
        x = 0.2 * k
        y, z = north * x, rise * x
        poses = {name: [x, y + away, z, 0.0, 0.0, 0.0, 1.0] for name, away in (("truck", 0.0), ("wheel", -0.25))}
        records.append(TruthRecord(len(records) + 1, 0.25 * k, poses, {}, {"way_m": x}))
    return records


@pytest.mark.parametrize(("rise", "north", "is_map"), [(0.0, 0.0, True), (0.1, 0.5, True), (0.2, 0.1, False)])
def test_drive_on_ground_is_seen_from_where_it_moves_most(
    tmp_path: Path, rise: float, north: float, is_map: bool
) -> None:
    """From above the wheel is south of the truck; from the south it is before it."""
    image = drawn(tmp_path, driven(rise, north), **ON_GROUND)
    truck, wheel = places(image, BODY, 120), places(image, WHEEL, 160)
    first = truck[truck[:, 1] < truck[:, 1].min() + 10]
    beside = wheel[wheel[:, 1] < wheel[:, 1].min() + 10]
    assert (beside[:, 0].min() > first[:, 0].max()) == is_map


def test_wheel_is_drawn_each_time_with_its_vehicle(tmp_path: Path) -> None:
    image = drawn(tmp_path, driven(0.0, 0.5), **ON_GROUND)
    truck, wheel = places(image, BODY, 120), places(image, WHEEL, 160)
    for found in (truck, wheel):
        columns = np.unique(found[:, 1])
        assert len(columns[np.r_[True, np.diff(columns) > 5]]) >= 4
    assert np.ptp(truck[:, 1]) == pytest.approx(np.ptp(wheel[:, 1]), rel=0.1)


def test_what_moves_with_the_vehicle_and_reaches_far_is_within_the_picture(tmp_path: Path) -> None:
    """The picture without walls is as wide as the vehicle, and an arm of 2 m, of which only the end is green."""
    arm = [
        {"kind": "box", "half_size_m": [1.0, 0.02, 0.02], "center_m": [1.0, 0.0, 0.0], "rgb": [90, 90, 90]},
        {"kind": "box", "half_size_m": [0.1, 0.1, 0.1], "center_m": [2.0, 0.0, 0.0], "rgb": list(STONE)},
    ]
    still = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    records: list[Record] = [TruthRecord(k + 1, 0.25 * k, {"truck": still, "arm": still}, {}, {}) for k in range(9)]
    ground = {"ground": SCENE["statics"]["floor"]}
    image = drawn(tmp_path, records, statics=ground, bodies={"truck": SCENE["bodies"]["truck"], "arm": arm})
    end, truck = places(image, STONE, 160), places(image, BODY, 120)
    assert len(end) > 0
    assert np.ptp(end, axis=0)[1] / np.ptp(truck, axis=0)[1] == pytest.approx(0.2 / 0.6, rel=0.1)
