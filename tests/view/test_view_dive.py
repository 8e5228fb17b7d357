"""The view of a dive: tether, broken thrusters, camera images, link state, and labels."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim.prelude.task import Page
from snr_sim.recording.records import Header, PageRecord, Record, TruthRecord
from snr_sim.recording.scene import TETHER_LINE, tether_frames
from snr_sim.view.view import write_view

rr = pytest.importorskip("rerun")
from rerun.chunk import RrdReader  # noqa: E402

TETHER = {"anchor_m": [1.0, 0.0, 0.0], "body": "vehicle", "place_m": [0.0, 0.0, 0.5], "length_m": 3.0}
SURFACE = [[5.0, 4.0, 0.0], [-5.0, 4.0, 0.0], [-5.0, -4.0, 0.0], [5.0, -4.0, 0.0], [5.0, 4.0, 0.0]]
GATE = [[3.0, 0.5, -1.0], [3.0, 0.5, -2.0], [3.0, -0.5, -2.0], [3.0, -0.5, -1.0], [3.0, 0.5, -1.0]]
QUARTER = [0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)]  # to the left


@pytest.fixture(autouse=True)
def _rerun_is_strict() -> Iterator[None]:
    """Otherwise a wrong argument to rerun is a warning, and rows are missing."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def header() -> Header:
    def line(points: list[list[float]], label: str) -> dict[str, Any]:
        return {"kind": "polyline", "points_m": points, "rgb": [9, 9, 9], "radius_m": 0.03, "label": label}

    box = {"kind": "box", "half_size_m": [0.2, 0.2, 0.1], "center_m": [0.0, 0.0, 0.0], "rgb": [9, 9, 9]}
    return Header(
        version="0.1.0", python="3.11", platform="here", packages={}, scenario="dive", robot="urov", controller="holds",
        roles=["urov"], engine="none", io="sim", seed=3, options={}, nodes=["urov"], clock="sim", commands={},
        sources={},
        scene={
            "statics": {"surface": line(SURFACE, "water surface"), "gate_1": line(GATE, "gate 1")},
            "bodies": {"vehicle": [box]},
            "tethers": {"tether": TETHER},
        },
    )  # fmt: skip


def truth(seq: int, pull_n: float = 0.0, broken: float = 0.0) -> TruthRecord:
    pose = [0.1 * seq, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0]
    vectors = {"T1": [*pose[:2], -1.1, 0.0, 0.0, 40.0], "current": [*pose[:3], 8.0, 0.0, 0.0]}
    vectors["tether"] = [*pose[:3], pull_n, 0.0, 0.0]
    return TruthRecord(seq, 0.1 * seq, {"vehicle": pose}, vectors, {"depth_m": 1.0, "broken_T1": broken})


def page(seq: int, key: str, data: Any, node: str = "urov", origin: str = "urov") -> PageRecord:
    raw = msgspec.Raw(b"[" + Page(key, data, origin, seq * 0.1).serialize() + b"]")
    return PageRecord(seq, seq * 0.1, node, "store_page", key, raw, 1, 0, [])


def rows(tmp_path: Path, records: list[Record]) -> dict[str, dict[str, list[Any]]]:
    """Return the values of each component of each entity, in the order in which they were sent."""
    write_view(header(), records, tmp_path / "view.rrd", 1000)
    found: dict[str, dict[str, list[Any]]] = {}
    for chunk in RrdReader(str(tmp_path / "view.rrd")).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if ":" in name:
                of_entity = found.setdefault(str(chunk.entity_path), {})
                of_entity.setdefault(name, []).extend(batch.column(name).to_pylist())
    return found


def test_tether_spans_from_anchor_to_vehicle(tmp_path: Path) -> None:
    tether = rows(tmp_path, [truth(1), truth(2)])["/world/tether"]
    assert tether["Transform3D:translation"] == [[[1.0, 0.0, 0.0]]] * 2
    spans = [row[0][:3] for row in tether["Transform3D:mat3x3"]]
    assert np.allclose(spans, [[-0.9, 0.0, -0.5], [-0.8, 0.0, -0.5]])


def test_slack_tether_sags_and_taut_tether_is_straight() -> None:
    poses = np.array([[0.0, 0.0, -2.0, 0.0, 0.0, 0.0, 1.0], [-8.0, 2.0, -3.0, *QUARTER]])
    for pose, frame in zip(poses, tether_frames(TETHER, poses), strict=True):
        line = TETHER_LINE @ frame.T + np.array(TETHER["anchor_m"])
        assert np.allclose(line[0], TETHER["anchor_m"])
        assert np.allclose(line[-1], pose[:3] + np.array(TETHER["place_m"]))
        length_m = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
        is_slack = np.linalg.norm(line[-1] - line[0]) < 3.0
        assert (length_m > 1.01 * np.linalg.norm(line[-1] - line[0])) == is_slack
        assert not is_slack or line[8][2] < 0.5 * (line[0][2] + line[-1][2]) - 0.01  # down, not up


def test_tether_color_is_redder_for_larger_force(tmp_path: Path) -> None:
    colors = rows(tmp_path, [truth(1, 0.0), truth(2, 10.0), truth(3, 40.0)])["/world/tether"]["LineStrips3D:colors"]
    green = [color[0] >> 16 & 0xFF for color in colors]
    assert green[0] > green[1] > green[2]


def test_broken_thruster_is_marked_from_its_failure_on(tmp_path: Path) -> None:
    found = rows(tmp_path, [truth(1), truth(2, broken=1.0), truth(3, broken=1.0)])["/world/broken/T1"]
    assert [len(row) for row in found["Points3D:positions"] if row is not None] == [0, 1, 1]
    assert ["T1 is broken"] in found["Points3D:labels"]
    assert not any("broken" in entity for entity in rows(tmp_path, []))


def test_flags_are_drawn_in_steps_and_numbers_interpolated(tmp_path: Path) -> None:
    found = rows(tmp_path, [truth(1), page(2, "controls", {"is_armed": True, "surge": 0.5})])
    mode = "SeriesLines:interpolation_mode"
    step = rr.components.InterpolationMode.StepAfter.value
    assert found["/urov/pages/controls/is_armed"][mode] == [[step]]
    assert found["/truth/broken_T1"][mode] == [[step]]
    assert mode not in found["/urov/pages/controls/surge"]


def test_angles_are_shown_in_degrees(tmp_path: Path) -> None:
    angles = {"yaw_rad": 1.0, "rate_radps": [0.5, 0.0, 0.0]}
    found = rows(tmp_path, [truth(1), page(2, "imu", angles)])
    scalars = {name: found[f"/urov/pages/imu/{name}"]["Scalars:scalars"] for name in ("yaw_rad", "rate_radps/0")}
    assert scalars["yaw_rad"] == [[pytest.approx(57.29578)]]
    assert scalars["rate_radps/0"] == [[pytest.approx(28.64789)]]


def test_depth_is_shown_negative_with_sign_in_name(tmp_path: Path) -> None:
    """It went up in rerun when the vehicle dived, and down in pictures."""
    found = rows(tmp_path, [truth(1), page(2, "sonar", {"depth_m": 2.0, "distance_m": 4.5, "depth": 3.0})])
    scalars = {
        entity: (found[entity]["SeriesLines:names"], found[entity]["Scalars:scalars"])
        for entity in ("/truth/depth_m", *(f"/urov/pages/sonar/{name}" for name in ("depth_m", "distance_m", "depth")))
    }
    assert scalars == {
        "/truth/depth_m": ([["true -depth"]], [[-1.0]]),
        "/urov/pages/sonar/depth_m": ([["sonar -depth"]], [[-2.0]]),
        "/urov/pages/sonar/distance_m": ([["sonar distance"]], [[4.5]]),
        "/urov/pages/sonar/depth": ([["sonar depth"]], [[3.0]]),  # the unit may not be metres
    }


def test_gates_surface_and_current_are_labelled(tmp_path: Path) -> None:
    found = rows(tmp_path, [truth(1)])
    assert found["/world/gate_1/label"]["Points3D:labels"] == [["gate 1"]]
    assert found["/world/surface/label"]["Points3D:labels"] == [["water surface"]]
    assert "/world/surface/sheet" in found
    assert ["current"] in found["/world/arrows/current/newtons"]["Arrows3D:labels"]
    vectors = [found[f"/world/arrows/{name}/newtons"]["Arrows3D:colors"][0] for name in ("current", "T1")]
    assert vectors[0] != vectors[1]
    scales = [found[f"/world/arrows/{name}/newtons"]["Transform3D:scale"][-1][0][0] for name in ("current", "T1")]
    assert scales[0] * 8.0 == pytest.approx(scales[1] * 40.0)  # each as long as the vehicle at its strongest
    assert "/world/arrows/tether" not in found


def test_gate_label_is_above_the_gate(tmp_path: Path) -> None:
    """It hung from the highest corner, down over the opening: the viewer writes down from there."""
    found = rows(tmp_path, [truth(1)])
    assert found["/world/gate_1/label"]["Points3D:positions"] == [[[3.0, 0.0, -0.5]]]
    assert found["/world/surface/label"]["Points3D:positions"] == [[[5.0, 4.0, 0.0]]]


def test_camera_images_are_stored_pixel_by_pixel(tmp_path: Path) -> None:
    images = [np.random.default_rng(k).integers(0, 255, (3, 4, 3), np.uint8) for k in range(3)]
    pages: list[Record] = [page(k + 1, "camera", {"rgb": image, "stamp_s": k}) for k, image in enumerate(images)]
    found = rows(tmp_path, pages)["/urov/pages/camera/rgb"]
    assert [bytes(row[0]) for row in found["Image:buffer"]] == [image.tobytes() for image in images]
    shape = found["Image:format"][0][0]
    assert (shape["width"], shape["height"]) == (4, 3)


def test_link_has_rates_and_round_trip_next_to_its_page(tmp_path: Path) -> None:
    reports = [{"up": k > 0, "rtt_s": 0.004, "sent": 5 * k, "peers": {}} for k in range(3)]
    found = rows(tmp_path, [page(k, "link_tether", report) for k, report in enumerate(reports)])
    assert found["/urov/links/link_tether/sent_hz"]["Scalars:scalars"] == [[0.0], [50.0], [50.0]]
    assert found["/urov/links/link_tether/round_trip_ms"]["Scalars:scalars"] == [[4.0]] * 3
    assert found["/urov/pages/link_tether/sent"]["Scalars:scalars"] == [[0.0], [5.0], [10.0]]
