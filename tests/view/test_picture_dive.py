"""The picture of a dive: its required content, with positions and colours. Its design is not tested."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from snr_sim.recording.records import Header, Record, TruthRecord
from snr_sim.view import picture, picture_dive, picture_layout, picture_sheet, picture_water

pytest.importorskip("matplotlib")
image_module = pytest.importorskip("PIL.Image")

BOX = {"kind": "box", "half_size_m": [0.25, 0.2, 0.15], "center_m": [0.0, 0.0, 0.0], "rgb": [210, 160, 60]}
EDGE = [[-9.0, -6.0], [9.0, -6.0], [9.0, 6.0], [-9.0, 6.0], [-9.0, -6.0]]
RIM_RGB, GATE_RGB = (250, 0, 250), (0, 250, 0)


def line(points: list[list[float]], rgb: tuple[int, int, int], **more: Any) -> dict[str, Any]:
    return {"kind": "polyline", "points_m": points, "rgb": list(rgb), "radius_m": 0.03, **more}


def gate(x: float, name: str) -> dict[str, Any]:
    corners = [[x, 0.7, -1.0], [x, 0.7, -2.0], [x, -0.7, -2.0], [x, -0.7, -1.0], [x, 0.7, -1.0]]
    return line(corners, GATE_RGB, label=name)


def header(*gates: dict[str, Any], **scene: Any) -> Header:
    statics = {
        "surface": line([[x, y, 0.0] for x, y in EDGE], (9, 9, 9)),
        "rim": line([[x, y, 0.4] for x, y in EDGE], RIM_RGB),
        **{shape["label"]: shape for shape in gates},
    }
    fields: dict[str, Any] = {
        "version": "0.1.0", "python": "3.11", "platform": "here", "packages": {}, "scenario": "urov", "robot": "urov",
        "controller": "holds", "roles": ["urov"], "engine": "none", "io": "sim", "seed": 7, "options": {},
        "nodes": ["urov"], "clock": "sim", "commands": {}, "sources": {},
        "scene": {"statics": statics, "bodies": {"vehicle": [BOX]}, **scene},
    }  # fmt: skip
    return Header(**fields)


def dive(to_m: list[float], turns_rad: float = 0.0, pull_n: float = 1.0, **values: list[float]) -> list[Record]:
    """A straight dive from 1 m below the surface, in a current, with a yaw rotation at the end."""
    records: list[Record] = []
    for i in range(21):
        place = [i / 20.0 * end for end in to_m]
        half = 0.5 * turns_rad * i / 20.0
        pose = [place[0], place[1], place[2] - 1.0, 0.0, 0.0, math.sin(half), math.cos(half)]
        vectors = {"T1": [*pose[:3], 5.0, 0.0, 1.0], "current": [*pose[:3], 8.0, 8.0, 0.0]}
        vectors["tether"] = [*pose[:3], 0.0, 0.0, pull_n]
        numbers = {"depth_m": -pose[2], **{name: series[i] for name, series in values.items()}}
        records.append(TruthRecord(i, 0.5 * i, {"vehicle": pose}, vectors, numbers))
    return records


def from_the_tenth(value: float) -> list[float]:
    return [0.0] * 10 + [value] * 11


@pytest.fixture
def written_texts(monkeypatch: pytest.MonkeyPatch) -> dict[str, tuple[float, float]]:
    """What is written on the sheet, and where."""
    written: dict[str, tuple[float, float]] = {}
    write = picture_sheet.Sheet.text

    def note(self: Any, at: Any, text: str, *args: Any, **options: Any) -> None:
        written[text] = at
        write(self, at, text, *args, **options)

    monkeypatch.setattr(picture_sheet.Sheet, "text", note)
    return written


def drawn(tmp_path: Path, records: list[Record], ran: Header | None = None) -> Any:
    picture.draw_run(ran or header(), records, tmp_path / "run.png")
    with image_module.open(tmp_path / "run.png") as image:
        return image.convert("RGB")


def count(image: Any, rgb: tuple[int, int, int], box: tuple[int, int, int, int] | None = None) -> int:
    """Return how many pixels have about this colour; a picture has a palette of 128."""
    part = image.crop(box) if box else image
    colors = part.getcolors(1 << 24)
    return sum(n for n, found in colors if max(abs(a - b) for a, b in zip(found, rgb, strict=True)) < 24)


@pytest.mark.parametrize(
    ("to_m", "turns_rad", "larger"),
    [
        ([1.0, 0.0, -3.0], 0.0, "from the south"),
        ([1.0, 4.0, -3.0], 0.0, "from the south"),
        ([1.0, 4.0, -3.0], 1.5, "from above"),
        ([1.0, 4.0, -0.2], 0.0, "from above"),
        ([4.0, 0.1, -2.0], 1.5, "from the south"),
        ([0.3, 0.1, 0.0], 0.0, "from above"),
    ],
)
def test_dive_has_two_views_with_larger_one_by_motion(
    tmp_path: Path, written_texts: dict[str, tuple[float, float]], to_m: list[float], turns_rad: float, larger: str
) -> None:
    drawn(tmp_path, dive(to_m, turns_rad))
    views = {text.partition(":")[0]: at for text, at in written_texts.items() if text.startswith("from ")}
    above, south = views["from above"][1], views["from the south"][1]
    upper, lower = south - above, picture_layout.SCENE[3] - south
    assert (upper > lower) == (larger == "from above")
    assert "current 0.28 m/s" in written_texts or larger == "from the south"  # only what is seen of it from there
    assert "current 0.20 m/s" in written_texts or larger == "from above"


def test_planar_dive_has_south_view_and_pitch_only(
    tmp_path: Path, written_texts: dict[str, tuple[float, float]]
) -> None:
    angles = {"pitch_rad": [0.1] * 21, "yaw_rad": [0.0] * 21, "sway_mps": [0.0] * 21, "surge_mps": [0.5] * 21}
    image = drawn(tmp_path, dive([4.0, 0.0, -1.0], **angles), header(is_planar=True))
    assert {"from the south: east is right", "pitch", "surge", "to the east"} <= written_texts.keys()
    assert not any(text.startswith("from above") for text in written_texts)
    assert not {"heading", "heading [°]", "sway", "to the north"} & written_texts.keys()
    assert count(image, picture_dive.PATH) > 100
    drawn(tmp_path, dive([4.0, 0.0, -1.0], **angles))
    assert {"heading", "sway", "to the north", "from above: north is up"} <= written_texts.keys()


def test_south_view_has_one_surface_with_water_below(tmp_path: Path) -> None:
    image = drawn(tmp_path, dive([0.5, 0.0, -2.0]))
    top = int(2 * (picture_layout.SCENE[1] + 0.4 * (picture_layout.SCENE[3] - picture_layout.SCENE[1])))
    south = (100, top, 1184, 900)
    assert count(image, RIM_RGB, south) == 0  # the pool's edge, drawn from the side, would look like another surface
    column = [image.getpixel((104, y)) for y in range(top + 20, 900)]
    blue = [abs(pixel[2] - picture_water.WATER[2]) < 12 and pixel[2] > 60 for pixel in column]
    assert not blue[0]
    assert all(blue[blue.index(True) + 4 :])


def test_map_has_no_water_outside_pool(tmp_path: Path) -> None:
    image = drawn(tmp_path, dive([8.0, 5.0, -0.1]))
    assert count(image, RIM_RGB) > 500
    assert count(image, picture_water.DECK) > 5_000


def test_gates_far_from_path_are_shown_whole_with_names(
    tmp_path: Path, written_texts: dict[str, tuple[float, float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[Any] = []
    paint = picture_sheet.Sheet.paint

    def note(self: Any, parts: Any, *args: Any) -> None:
        lines.extend(point for part in parts if part.rgb == GATE_RGB for point in part.points.tolist())
        paint(self, parts, *args)

    monkeypatch.setattr(picture_sheet.Sheet, "paint", note)
    drawn(tmp_path, dive([0.5, 0.0, -1.0]), header(gate(3.0, "gate 1"), gate(8.0, "gate 2")))
    assert {"gate 1", "gate 2"} <= set(written_texts)
    left, _, right, _ = picture_layout.SCENE
    xs = sorted({round(x, 3) for x, _ in lines})
    assert len(xs) == 2  # two gates, each a line from where they are seen, and none of them cut at an edge
    assert left < xs[0]
    assert xs[-1] < right


def test_broken_thruster_is_crossed_out_and_listed(
    tmp_path: Path, written_texts: dict[str, tuple[float, float]]
) -> None:
    whole = drawn(tmp_path, dive([2.0, 0.0, -1.0], broken_T1=[0.0] * 21))
    assert count(whole, picture_dive.BROKEN) == 0
    assert not any("fails" in text for text in written_texts)
    broken = drawn(tmp_path, dive([2.0, 0.0, -1.0], broken_T1=from_the_tenth(1.0)))
    assert count(broken, picture_dive.BROKEN) > 100
    assert "5.0 s  T1 fails" in written_texts
    assert "push of T1" in written_texts


def test_leak_and_payload_are_drawn_and_listed(tmp_path: Path, written_texts: dict[str, tuple[float, float]]) -> None:
    drawn(tmp_path, dive([0.5, 0.0, -2.0], water_l=from_the_tenth(0.4)))
    assert {"5.0 s  water comes in", "water in the hull"} <= set(written_texts)
    load = drawn(tmp_path, dive([0.5, 0.0, -2.0], load_kg=[0.6] * 15 + [0.0] * 6))
    assert "7.5 s  payload of 0.6 kg released" in written_texts
    assert count(load, picture_dive.LOAD) > 100


@pytest.mark.parametrize(
    ("length_m", "pull_n", "words", "color"),
    [(35.0, 0.2, "tether: slack, pulls 0.2 N", picture_water.SLACK), (0.5, 40.0, "tether: taut, pulls 40.0 N", None)],
)
def test_tether_is_drawn_with_its_force(
    tmp_path: Path,
    written_texts: dict[str, tuple[float, float]],
    length_m: float,
    pull_n: float,
    words: str,
    color: tuple[int, int, int] | None,
) -> None:
    tether = {"anchor_m": [2.0, 0.0, 0.0], "body": "vehicle", "place_m": [0.0, 0.0, 0.1], "length_m": length_m}
    image = drawn(tmp_path, dive([0.5, 0.0, -2.0], pull_n=pull_n), header(tethers={"tether": tether}))
    assert words in written_texts
    assert count(image, color or picture_water.TAUT) > 200


def test_time_labels_do_not_overlap_bodies(tmp_path: Path, written_texts: dict[str, tuple[float, float]]) -> None:
    drawn(tmp_path, dive([8.0, 0.3, -0.1]))
    times = [at for text, at in written_texts.items() if text.endswith(" s") and text[:-2].isdigit()]
    assert len(times) > 4
    labels = picture_layout.Labels([(100.0, 100.0)], 20.0, (0.0, 0.0, 200.0, 200.0))
    assert labels.find_free([(90.0, 100.0), (125.0, 100.0)], 30.0, 10.0) == (125.0, 100.0)
    assert labels.find_free([(130.0, 105.0), (180.0, 100.0), (125.0, 112.0)], 30.0, 10.0) == (125.0, 112.0)
    assert labels.find_free([(90.0, 100.0), (190.0, 100.0)], 30.0, 10.0) is None


def test_labels_avoid_lines() -> None:
    labels = picture_layout.Labels([], 0.0, (0.0, 0.0, 200.0, 200.0))
    labels.keep_free(picture_layout.spread(np.array([[50.0, 0.0], [50.0, 190.0]])), 2.0)
    assert labels.find_free([(40.0, 95.0), (60.0, 95.0)], 20.0, 10.0) == (60.0, 95.0)


def test_picture_contains_scenario_metrics(tmp_path: Path, written_texts: dict[str, tuple[float, float]]) -> None:
    measured: dict[str, float | str] = {"settling_s": 5.9, "gates": 3, "fault": "stuck", "energy_j": 2447.6}
    picture.draw_run(header(), dive([0.5, 0.0, -2.0]), tmp_path / "run.png", "held", None, True, measured)
    assert "settling 5.90 s, fault stuck, energy 2448 J" in written_texts
    assert "held, 10.0 s" in written_texts


def test_outcome_reason_replaces_metrics_and_is_truncated(
    tmp_path: Path, written_texts: dict[str, tuple[float, float]]
) -> None:
    records, path = dive([0.5, 0.0, -2.0]), tmp_path / "run.png"
    picture.draw_run(header(), records, path, "failed", None, False, {"settling_s": 5.9}, "ended 1 m off.")
    assert "ended 1 m off." in written_texts
    assert not any("settling" in text for text in written_texts)
    picture.draw_run(header(), records, path, "failed", None, False, {}, "it was off, and off again, " * 20)
    (cut,) = (text for text in written_texts if text.startswith("it was off"))
    assert cut.endswith(" ...")
    assert 100 < len(cut) < 400


def test_dive_picture_is_reproducible_and_small(tmp_path: Path) -> None:
    files = []
    for name in ("first.png", "second.png"):
        picture.draw_run(header(gate(3.0, "gate 1")), dive([8.0, 0.3, -0.1]), tmp_path / name)
        files.append((tmp_path / name).read_bytes())
    assert files[0] == files[1]
    assert len(files[0]) < 120_000


def test_dive_of_single_true_state_is_drawn(tmp_path: Path) -> None:
    assert drawn(tmp_path, dive([1.0, 0.0, -1.0])[:1]).size == (1800, 1000)
