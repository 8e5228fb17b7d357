"""Assignment of numbers to plots, and their order."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest

from snr_sim.view.view_blueprint import FLAGS, Layout, PlotLine, blueprint, color_and_width, plots


def line(name: str, unit: str = "m", is_truth: bool = False, plot: str = "") -> PlotLine:
    return PlotLine(f"/{name}", name, unit, is_truth, plot)


def names(lines: list[PlotLine], changed_flags: tuple[str, ...] = ()) -> list[list[str]]:
    return [[one.name for one in group] for group in plots(lines, changed_flags).values()]


def test_plots_group_truth_with_estimates_of_same_quantity() -> None:
    lines = [
        line("true depth", is_truth=True),
        line("sonar depth"),
        line("position_fix position 0"),
        line("vehicle depth"),
    ]
    assert names(lines) == [["true depth", "sonar depth", "vehicle depth"], ["position_fix position 0"]]


def test_plots_without_common_quantity_group_by_unit() -> None:
    lines = [line("true vertical", "m/s", True), line("true lateral", "m/s", True), line("radar velocity", "m/s")]
    assert names(lines) == [["true vertical", "true lateral", "radar velocity"]]


def test_plots_treat_yaw_and_heading_as_synonyms() -> None:
    lines = [line("true yaw", "rad", True), line("controls heading", "rad"), line("imu roll", "rad")]
    assert names(lines) == [["true yaw", "controls heading"], ["imu roll"]]


def test_plots_are_ordered_truth_links_estimates_flags() -> None:
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


def test_constant_flag_has_no_line() -> None:
    lines = [line("is armed", "", plot=FLAGS), line("is stopped", "", plot=FLAGS)]
    assert names(lines, ("/is armed",)) == [["is armed"]]
    assert names(lines) == []


def test_lines_of_a_plot_have_distinct_colors() -> None:
    """Eight pulses were drawn in five colours."""
    lines: list[PlotLine] = []
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
def test_plots_of_two_runs_show_the_whole_time(roots: list[str], shown_ns: tuple[int, int] | None) -> None:
    rrb = pytest.importorskip("rerun.blueprint")
    layout = Layout("run", roots=roots, lines=[line("height"), line("speed", "m/s")], end_s=90.0)
    axes = [view.properties["TimeAxis"] for view in views_of(rrb, layout) if isinstance(view, rrb.TimeSeriesView)]
    assert len(axes) == 2
    for axis in axes:
        shown = axis.view_range and axis.view_range.as_arrow_array().to_pylist()
        assert shown == (shown_ns and [{"start": shown_ns[0], "end": shown_ns[1]}])


def test_camera_images_are_excluded_from_spatial_views() -> None:
    rrb = pytest.importorskip("rerun.blueprint")
    layout = Layout("run", bodies=["/world/vehicle"], cameras=["/world/follower"], images=["/urov/pages/camera/rgb"])
    views = views_of(rrb, layout)
    in_space = [view.contents for view in views if isinstance(view, rrb.Spatial3DView)]
    assert len(in_space) == 2
    assert all("- /urov/pages/camera/rgb" in contents for contents in in_space)
    assert [view.origin for view in views if isinstance(view, rrb.Spatial2DView)] == ["/urov/pages/camera/rgb"]
