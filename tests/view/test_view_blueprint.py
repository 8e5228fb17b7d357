"""Assignment of numbers to plots, and their order."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest

from snr_sim.view.view_blueprint import FLAGS, Layout, Line, blueprint, color_and_width, plots


def line(name: str, unit: str = "m", is_truth: bool = False, plot: str = "") -> Line:
    return Line(f"/{name}", name, unit, is_truth, plot)


def names(lines: list[Line], changed_flags: tuple[str, ...] = ()) -> list[list[str]]:
    return [[one.name for one in group] for group in plots(lines, changed_flags).values()]


def test_a_true_number_shares_its_plot_with_the_beliefs_of_its_name() -> None:
    lines = [line("true depth", is_truth=True), line("sonar depth"), line("place position 0"), line("vehicle depth")]
    assert names(lines) == [["true depth", "sonar depth", "vehicle depth"], ["place position 0"]]


def test_where_no_name_agrees_a_unit_shares_one_plot() -> None:
    lines = [line("true vertical", "m/s", True), line("true lateral", "m/s", True), line("radar velocity", "m/s")]
    assert names(lines) == [["true vertical", "true lateral", "radar velocity"]]


def test_yaw_and_heading_are_one_thing() -> None:
    lines = [line("true yaw", "rad", True), line("controls heading", "rad"), line("imu roll", "rad")]
    assert names(lines) == [["true yaw", "controls heading"], ["imu roll"]]


def test_what_is_true_comes_first_then_links_then_beliefs_and_last_what_was_yes_or_no() -> None:
    lines = [
        line("power voltage", "V"),
        line("up", "", plot="link tether: up (1) or down (0)"),
        line("controls is armed", "", plot=FLAGS),
        line("true speed", "m/s", True),
        line("true depth", "m", True),
    ]
    assert names(lines, ("/controls is armed",)) == [
        ["true depth"],
        ["true speed"],
        ["up"],
        ["power voltage"],
        ["controls is armed"],
    ]


def test_what_was_always_yes_or_always_no_has_no_line() -> None:
    lines = [line("is armed", "", plot=FLAGS), line("is stopped", "", plot=FLAGS)]
    assert names(lines, ("/is armed",)) == [["is armed"]]
    assert names(lines) == []


def test_no_two_lines_of_a_plot_have_one_colour() -> None:
    """Eight pulses were drawn in five colours."""
    lines: list[Line] = []
    colors = []
    for i in range(24):
        new = line(f"pwm {i}", "µs", is_truth=i >= 16)
        colors.append(color_and_width(new, lines)[0])
        lines.append(new)
    apart = min(math.dist(one, other) for one, other in itertools.combinations(colors, 2))
    assert apart > 15.0


def views_of(rrb: Any, layout: Layout) -> list[Any]:
    parts, views = [blueprint(rrb, layout).root_container], []
    while parts:
        part = parts.pop()
        parts += getattr(part, "contents", []) if isinstance(part, rrb.api.Container) else []
        views += [part] if isinstance(part, rrb.api.View) else []
    return views


@pytest.mark.parametrize(
    ("roots", "shown_ns"), [([""], None), (["/recorded", "/replayed"], (0, 90_000_000_000))], ids=["one", "two"]
)
def test_plots_of_two_runs_open_on_all_of_it(roots: list[str], shown_ns: tuple[int, int] | None) -> None:
    rrb = pytest.importorskip("rerun.blueprint")
    layout = Layout("run", roots=roots, lines=[line("height"), line("speed", "m/s")], end_s=90.0)
    axes = [view.properties["TimeAxis"] for view in views_of(rrb, layout) if isinstance(view, rrb.TimeSeriesView)]
    assert len(axes) == 2
    for axis in axes:
        shown = axis.view_range and axis.view_range.as_arrow_array().to_pylist()
        assert shown == (shown_ns and [{"start": shown_ns[0], "end": shown_ns[1]}])


def test_what_a_camera_saw_is_left_out_of_the_views_in_space() -> None:
    rrb = pytest.importorskip("rerun.blueprint")
    layout = Layout("run", bodies=["/world/vehicle"], cameras=["/world/follower"], images=["/urov/pages/camera/rgb"])
    views = views_of(rrb, layout)
    in_space = [view.contents for view in views if isinstance(view, rrb.Spatial3DView)]
    assert len(in_space) == 2
    assert all("- /urov/pages/camera/rgb" in contents for contents in in_space)
    assert [view.origin for view in views if isinstance(view, rrb.Spatial2DView)] == ["/urov/pages/camera/rgb"]
