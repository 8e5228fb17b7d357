"""The picture of a run: it is drawn, small, deterministic, and describes the events. Its design is not tested."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim.prelude.errors import MissingExtraError, TraceError
from snr_sim.recording.records import EndRecord, Header, Record, TruthRecord
from snr_sim.view import picture, picture_sheet
from snr_sim.view.picture_plots import Plot, span

matplotlib = pytest.importorskip("matplotlib")
image_module = pytest.importorskip("PIL.Image")

GROUND = {
    "kind": "mesh",
    "vertices_m": [[-90.0, -5.0, 0.0], [90.0, -5.0, 0.0], [90.0, 5.0, 0.0], [-90.0, 5.0, 0.0]],
    "triangles": [[0, 1, 2], [0, 2, 3]],
    "rgb": [110, 110, 110],
}
BOX = {"kind": "box", "half_size_m": [2.0, 2.0, 1.5], "center_m": [0.0, 0.0, 0.0], "rgb": [210, 160, 60]}
LEG = {"kind": "polyline", "points_m": [[1.0, 0.0, -1.0], [2.5, 0.0, -3.0]], "rgb": [200, 200, 200], "radius_m": 0.1}


def header(**changes: Any) -> Header:
    fields: dict[str, Any] = {
        "version": "0.1.0", "python": "3.11", "platform": "here", "packages": {}, "scenario": "lander_pad",
        "robot": "lander", "controller": "pad", "roles": ["lander"], "engine": "none", "io": "sim", "seed": 7,
        "options": {}, "nodes": ["lander"], "clock": "sim", "commands": {}, "sources": {},
        "scene": {"statics": {"ground": GROUND}, "bodies": {"module": [BOX, LEG]}},
    }  # fmt: skip
    return Header(**(fields | changes))


def descent(sideways_mps: float) -> list[Record]:
    """Twenty seconds of descent from 100 m to a ground on which the feet, 3 m below the centre, touch down."""
    records: list[Record] = []
    for k in range(81):
        t = 0.25 * k
        z, tilt = 3.0 + 100.0 * (1.0 - t / 20.0) ** 2, 0.1 * math.sin(t)
        pose = [sideways_mps * (20.0 - t), 0.0, z, 0.0, math.sin(tilt / 2), 0.0, math.cos(tilt / 2)]
        values = {
            "altitude_m": z - 3.0,
            "vertical_mps": -10.0 * (1.0 - t / 20.0),
            "throttle": 0.4,
            "fuel_kg": 600.0 - 5 * t,
        }
        vectors = {"thrust": [pose[0], 0.0, z - 1.5, 300.0, 0.0, 9e3]} if t > 5.0 else {}
        records.append(TruthRecord(len(records) + 1, t, {"module": pose}, vectors, values))
    return records


def drawn(tmp_path: Path, records: list[Record], **changes: Any) -> Path:
    path = tmp_path / "run.png"
    picture.draw_run(header(**changes), records, path)
    return path


@pytest.fixture
def words(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is written on the sheet."""
    written_texts: list[str] = []
    write = picture_sheet.Sheet.text

    def note(self: Any, at: Any, text: str, *args: Any, **options: Any) -> None:
        written_texts.append(text)
        write(self, at, text, *args, **options)

    monkeypatch.setattr(picture_sheet.Sheet, "text", note)
    return written_texts


def test_picture_has_expected_size_and_small_file(tmp_path: Path) -> None:
    path = drawn(tmp_path, descent(4.0))
    assert path.stat().st_size < 120_000
    with image_module.open(path) as image:
        assert image.format == "PNG"
        assert image.size == (1800, 1000)
        assert len(image.convert("RGB").getcolors(1 << 24)) > 50


def test_same_trace_makes_identical_picture(tmp_path: Path) -> None:
    assert drawn(tmp_path, descent(4.0)).read_bytes() == drawn(tmp_path, descent(4.0)).read_bytes()


def test_picture_contains_scenario_outcome_and_fuel(tmp_path: Path, words: list[str]) -> None:
    drawn(tmp_path, [*descent(4.0), EndRecord(99, 20.0, "lander", "landed", {})])
    assert "lander_pad" in words
    assert "seed 7, controller 'pad'" in words
    assert "landed, 20.0 s" in words
    assert any("100 kg of fuel" in text for text in words)


def test_picture_contains_only_the_evaluated_touchdown(tmp_path: Path, words: list[str]) -> None:
    judged = {"vertical_mps": 0.9, "lateral_mps": -0.33, "attitude_deg": -2.43, "rate_degps": 0.5}
    picture.draw_run(header(), descent(4.0), tmp_path / "run.png", "landed", judged)
    assert any("touchdown: vertical 0.9 m/s, lateral -0.3 m/s, attitude -2.4 °, rate 0.5 °/s" in text for text in words)
    words.clear()
    drawn(tmp_path, descent(4.0))
    assert not any("touchdown" in text for text in words)


def test_vertical_motion_is_drawn_along_time(tmp_path: Path, words: list[str]) -> None:
    drawn(tmp_path, descent(0.0))
    assert words.count("s") == 2  # the axis below the scene, and the one below the plots
    assert len([text for text in words if text.endswith(" s") and text[:-2].isdigit()]) > 3


def test_non_finite_values_leave_a_gap(tmp_path: Path) -> None:
    records = descent(4.0)
    odd = msgspec.structs.replace(records[3], values={"altitude_m": float("nan"), "throttle": float("inf")})
    assert drawn(tmp_path, [*records[:3], odd, *records[4:]]).is_file()


def test_single_true_state_is_drawn(tmp_path: Path) -> None:
    assert drawn(tmp_path, descent(4.0)[:1]).is_file()


def test_scene_without_ground_is_drawn(tmp_path: Path) -> None:
    assert drawn(tmp_path, descent(4.0), scene={"bodies": {"module": [BOX]}}).is_file()


def test_trace_without_true_states_raises(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="no true states"):
        drawn(tmp_path, [EndRecord(1, 0.0, "lander", "", {})])


def test_user_style_of_matplotlib_is_ignored_and_kept(tmp_path: Path) -> None:
    before = drawn(tmp_path, descent(4.0)).read_bytes()
    with matplotlib.rc_context({"font.size": 30.0, "lines.marker": "o", "axes.grid": True, "path.sketch": (1, 9, 2)}):
        assert drawn(tmp_path, descent(4.0)).read_bytes() == before
        assert matplotlib.rcParams["lines.marker"] == "o"
    assert "matplotlib.pyplot" not in sys.modules


def test_names_with_dollar_or_missing_glyph_are_written(tmp_path: Path, words: list[str]) -> None:
    drawn(tmp_path, descent(4.0), scenario="$x^$ \N{CJK UNIFIED IDEOGRAPH-6708}")
    assert "$x^$ \N{CJK UNIFIED IDEOGRAPH-6708}" in words


def test_missing_matplotlib_raises_with_install_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingExtraError, match=r"'matplotlib'[\s\S]*snr_sim\[view\]"):
        drawn(tmp_path, descent(4.0))


@pytest.mark.parametrize(("low", "high", "expected"), [(0.0, 1.0, [0.0, 0.5, 1.0]), (-3.0, 21.0, [0.0, 10.0, 20.0])])
def test_axes_have_round_numbers(low: float, high: float, expected: list[float]) -> None:
    sheet = picture_sheet.Sheet(100, 100)
    axes = sheet.axes((10.0, 10.0, 90.0, 90.0), (low, high))
    sheet.scale(axes.xaxis, 3)
    assert axes.get_xticks().tolist() == expected


def test_span_centers_constant_value() -> None:
    assert span(Plot("", [("still", np.zeros(2), np.full(2, 5.0))])) == (4.5, 5.5)


def test_landing_has_one_view_without_direction_label(tmp_path: Path, words: list[str]) -> None:
    drawn(tmp_path, descent(2.0))
    assert not [word for word in words if word.startswith("from ")]


def test_outcome_color_depends_on_success(tmp_path: Path) -> None:
    for success, color in ((True, picture.MET), (False, picture.NOT_MET), (None, picture.INK)):
        picture.draw_run(header(), descent(2.0), tmp_path / "run.png", "landed", None, success)
        with image_module.open(tmp_path / "run.png") as image:
            title = {rgb for _, rgb in image.convert("RGB").crop((1500, 20, 1780, 60)).getcolors(1 << 16)}
        others = {picture.MET, picture.NOT_MET, picture.INK} - {color}
        assert min(_apart(rgb, color) for rgb in title) < 20
        assert all(min(_apart(rgb, other) for rgb in title) > 20 for other in others)


def _apart(one: tuple[int, ...], other: tuple[int, ...]) -> int:
    return max(abs(a - b) for a, b in zip(one, other, strict=True))
