"""Layout of the viewer: the plot and label of each number, and the positions of the cameras."""

from __future__ import annotations

from collections.abc import Sequence
from colorsys import hsv_to_rgb
from dataclasses import dataclass, field
from math import degrees
from typing import Any

# Unit suffixes of names, and the unit as written under a plot.
UNITS: dict[str, str] = {
    "m": "m", "mps": "m/s", "mps2": "m/s²", "rad": "rad", "radps": "rad/s", "deg": "°", "degps": "°/s", "kg": "kg",
    "n": "N", "nm": "N m", "pa": "Pa", "j": "J", "l": "l", "v": "V", "a": "A", "ut": "µT", "s": "s", "ms": "ms",
    "us": "µs", "hz": "Hz",
}  # fmt: skip
# The most important units for students; others follow in the order in which they appear.
UNITS_FIRST = ("m", "m/s", "", "kg", "l", "°", "°/s", "rad", "rad/s")
FLAGS = "yes (1) or no (0)"  # title of the plot of all flags
FAILURES = "broken (1) or not (0)"
STATES = "states of machines"
SYNONYMS: dict[str, str] = {"yaw": "heading"}
UNITS_NOT_PLOTTED = ("s",)  # stamps: a straight line for each sensor, without information
MAX_PLOTS_BESIDE = 4
NARROW = 1.6  # ratio of height to width of the view of the whole path

# Distinguishable on white and on black, since the viewer follows the system's theme. Estimates are broad and pale, and
# truth is drawn on top of them as a thin line, so that noise and lag show at its sides.
TRUTH_COLORS = ((40, 100, 220, 255), (205, 45, 135, 255), (110, 110, 120, 255), (0, 140, 120, 255))
ESTIMATE_COLORS = (
    (245, 165, 80, 255), (95, 195, 130, 255), (95, 190, 215, 255), (225, 120, 110, 255), (185, 150, 230, 255),
)  # fmt: skip
TRUTH_WIDTH, ESTIMATE_WIDTH = 1.5, 3.5
GOLDEN_FRACTION = 0.618034  # step of the hue between further lines, in turns: no two hues get close
IN_DEGREES: dict[str, str] = {"rad": "°", "rad/s": "°/s"}  # as shown to users
DEPTH = "depth"


@dataclass(frozen=True)
class PlotLine:
    """One line in one plot."""

    entity: str  # path of the entity with its values
    name: str  # in the legend
    unit: str  # as text; empty if it has none
    is_truth: bool  # a true state of the plant; otherwise a value in a node's page
    plot: str = ""  # title of its plot; empty if it follows from unit and name
    is_step: bool = False  # whether it holds each value until the next; otherwise it is interpolated linearly


@dataclass
class Layout:
    """What the view holds, collected while it is written."""

    title: str  # of the run
    roots: list[str] = field(default_factory=lambda: [""])  # for two runs two such as '/recorded' and '/replayed'
    lines: list[PlotLine] = field(default_factory=list)
    logs: list[str] = field(default_factory=list)
    bodies: list[str] = field(default_factory=list)  # entities of the first body of each run
    cameras: list[str] = field(default_factory=list)  # entities that move with them
    low_m: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # corner of the box in which bodies moved
    high_m: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    landmarks: list[list[float]] = field(default_factory=list)  # corners of named objects in the world
    body_size_m: float = 1.0  # longest edge of the largest body
    is_in_water: bool = False  # whether there is a water surface
    contents: list[str] = field(default_factory=list)  # entities of pages as text, one for each node
    images: list[str] = field(default_factory=list)  # entities of camera images
    changed_flags: list[str] = field(default_factory=list)  # entities of flags that changed during the run
    end_s: float = 0.0  # time of the last number
    has_divergences: bool = False  # whether differences between two runs are marked


def name_and_unit(path: Sequence[str]) -> tuple[str, str]:
    """Return the name and the unit of a number.

    >>> name_and_unit(("inertial", "velocity_mps", "0"))
    ('inertial velocity 0', 'm/s')
    >>> name_and_unit(("engine", "throttle"))
    ('engine throttle', '')
    """
    words, unit = [], ""
    for part in path:
        stem, _, ending = part.rpartition("_")
        if stem and ending in UNITS:
            part, unit = stem, UNITS[ending]
        words.append(part.replace("_", " "))
    return " ".join(words), unit


def display_units(name: str, unit: str) -> tuple[str, str, float]:
    """Return a number's name in the viewer, its unit there, and its scale factor.

    Angles are in degrees. A depth is negative, because rerun (0.41) cannot invert an axis.

    >>> display_units("imu yaw rate", "rad/s")[:2], display_units("true depth", "m")
    (('imu yaw rate', '°/s'), ('true -depth', 'm', -1.0))
    """
    if unit in IN_DEGREES:
        return name, IN_DEGREES[unit], degrees(1.0)
    head, space, word = name.rpartition(" ")
    if word == DEPTH and unit == "m":
        return f"{head}{space}-{word}", unit, -1.0
    return name, unit, 1.0


def color_and_width(line: PlotLine, before: Sequence[PlotLine]) -> tuple[tuple[int, int, int, int], float]:
    """Return colour and width of a line: truth thin and on top, estimates broad, with a colour unique in its plot."""
    colors = TRUTH_COLORS if line.is_truth else ESTIMATE_COLORS
    here = line.unit, line.is_truth, line.plot
    place = sum((other.unit, other.is_truth, other.plot) == here for other in before)
    width = TRUTH_WIDTH if line.is_truth else ESTIMATE_WIDTH
    if place < len(colors):
        return colors[place], width
    hue = (0.05 + (place - len(colors)) * GOLDEN_FRACTION) % 1.0
    red, green, blue = hsv_to_rgb(hue, *((0.75, 0.7) if line.is_truth else (0.45, 0.85)))
    return (round(255 * red), round(255 * green), round(255 * blue), 255), width


def plots(lines: Sequence[PlotLine], changed_flags: Sequence[str] = ()) -> dict[str, list[PlotLine]]:
    """Return lines by plot, with quantity and unit as titles; the most important plots for students come first.

    Numbers of one unit share a plot, except for a true number with estimates of the same name, which have their own.
    """
    by_unit: dict[str, list[PlotLine]] = {unit: [] for unit in UNITS_FIRST}
    named: dict[str, list[PlotLine]] = {}
    for line in lines:
        if line.plot and not (line.plot == FLAGS and line.entity not in changed_flags):
            named.setdefault(line.plot, []).append(line)
        elif not line.plot and line.unit not in UNITS_NOT_PLOTTED:
            by_unit.setdefault(line.unit, []).append(line)
    groups = [group for unit_group in by_unit.values() for group in _by_quantity(unit_group)]
    true = [group for group in groups if group[0].is_truth]
    estimated = [group for group in groups if not group[0].is_truth]
    flags, first = named.pop(FLAGS, []), MAX_PLOTS_BESIDE - 1
    return {
        **{_title(group): group for group in true[:first]},
        **named,
        **{_title(group): group for group in [*true[first:], *estimated]},
        **({FLAGS: flags} if flags else {}),
    }


def _by_quantity(lines: Sequence[PlotLine]) -> list[list[PlotLine]]:
    """Return lines of one unit by plot: each true one with the estimates whose names end alike, then the rest."""
    left, groups = list(lines), []
    for true in [line for line in lines if line.is_truth]:
        alike = [line for line in left if not line.is_truth and _quantity(line) == _quantity(true)]
        if alike:
            groups.append([true, *alike])
            left = [line for line in left if line is not true and line not in alike]
    true_ones = [line for line in left if line.is_truth]
    if groups and true_ones:
        groups.append(true_ones)
        left = [line for line in left if not line.is_truth]
    return [*groups, *([left] if left else [])]


def _quantity(line: PlotLine) -> str:
    last = line.name.rpartition(" ")[2]
    return SYNONYMS.get(last, last)


def _title(lines: Sequence[PlotLine]) -> str:
    truth, unit = [line.name for line in lines if line.is_truth], lines[0].unit
    names = list(dict.fromkeys(truth or [line.name for line in lines]))
    shown = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
    return f"{shown} [{unit}]" if unit else shown


def blueprint(rrb: Any, layout: Layout, follow_time: bool = False) -> Any:
    """Return the layout for rerun, of which `rrb` is the module blueprint; `follow_time` stays with the newest data."""
    left: list[Any] = []
    if layout.bodies:
        left.append(rrb.Horizontal(_follow(rrb, layout), _overview(rrb, layout, follow_time), column_shares=[3, 2]))
    cameras = [rrb.Spatial2DView(name="what the camera saw", origin=entity) for entity in layout.images]
    below = _logs(rrb, layout)
    left.append(rrb.Horizontal(below, *cameras, column_shares=[2, *([1] * len(cameras))]) if cameras else below)
    parts: list[Any] = [rrb.Vertical(contents=left, row_shares=[7, 3] if len(left) == 2 else None)]
    beside = _plots(rrb, layout)
    if beside:
        parts.append(beside)
    return rrb.Blueprint(
        rrb.Horizontal(contents=parts, column_shares=[4, 3] if len(parts) == 2 else None, name=layout.title),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="sim_time", play_state="following" if follow_time else "playing"),
        auto_views=False,
        auto_layout=False,
    )


def _follow(rrb: Any, layout: Layout) -> Any:
    """Return a camera that follows the first body."""
    reach = 2.4 * layout.body_size_m
    position, hidden = [0.25 * reach, -reach, 0.3 * reach], [f"{body}/marker" for body in layout.bodies]
    return _in_space(rrb, layout, "close-up: the camera follows", hidden, position, [0.0] * 3, origin=layout.cameras[0])


def _in_space(
    rrb: Any, layout: Layout, name: str, hidden: Sequence[str], position: list[float], target: list[float], **more: Any
) -> Any:
    """Return a spatial view of everything but some entities and camera images, for which rerun shows a warning."""
    return rrb.Spatial3DView(
        name=name,
        contents=["+ /**", *(f"- {entity}" for entity in (*hidden, *layout.images))],
        line_grid=False,
        background=[10, 12, 20],
        eye_controls=rrb.EyeControls3D(kind="Orbital", position=position, look_target=target, eye_up=[0, 0, 1]),
        **more,
    )


def _overview(rrb: Any, layout: Layout, follow_time: bool) -> Any:
    """Return a view of the whole path with its landmarks from the south: x to the right, z up."""
    low, high = layout.low_m, layout.high_m
    if follow_time:  # the path is not known yet, so look at the world's origin, where ground objects are
        low, high = [min(0.0, a) for a in low], [max(0.0, b) for b in high]
    low = [min(one) for one in zip(low, *layout.landmarks, strict=True)]
    high = [max(one) for one in zip(high, *layout.landmarks, strict=True)]
    center = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    up = 0.5 if layout.is_in_water else 0.15  # look into a pool from above
    wide, *others = (b - a for a, b in zip(low, high, strict=True))
    reach = 1.25 * max(NARROW * wide, *others, 3 * layout.body_size_m)
    position = [center[0], center[1] - reach, center[2] + up * reach]
    hidden = [f"{root}/world/arrows/**" for root in layout.roots]
    return _in_space(rrb, layout, "the whole way", hidden, position, center)


def _logs(rrb: Any, layout: Layout) -> Any:
    views = [
        rrb.TextLogView(
            name="tasks of " + log.strip("/").replace("/", " "),
            contents=[f"+ {log}/**", f"- {log}/pages/**", f"- {log}/contents"],
            columns=rrb.TextLogColumns(timeline_columns=["sim_time"], text_log_columns=["LogLevel", "Body"]),
            format_options=rrb.TextLogFormat(monospace_body=True),
        )
        for log in layout.logs
    ]
    views += [
        rrb.TextDocumentView(
            name="pages of " + entity.strip("/").removesuffix("/contents").replace("/", " "),
            contents=[f"+ {entity}"],
            format_options=rrb.archetypes.TextDocumentFormat(monospace=True),
        )
        for entity in layout.contents
    ]
    if layout.has_divergences:
        views.insert(0, rrb.TextLogView(name="divergences", contents=["+ /divergences/**"]))
    return rrb.Tabs(*views, rrb.TextDocumentView(name="run", contents=[f"+ {root}/run" for root in layout.roots]))


def _time_axis(rrb: Any, layout: Layout) -> Any:
    """Return linked time axes for one run, and independent ones that show the whole time for two runs.

    Linked axes open with half a minute around the cursor, and differences of two runs may be outside of it.
    """
    if len(layout.roots) == 1:
        return rrb.TimeAxis(link="linkToGlobal")
    begin, end = (rrb.TimeRangeBoundary.absolute(seconds=time_s) for time_s in (0.0, layout.end_s))
    return rrb.TimeAxis(link="independent", view_range=rrb.TimeRange(begin, end))


def _plots(rrb: Any, layout: Layout) -> Any:
    # Marks are at 0, so they fit only plots that include 0: not one of fuel.
    marks = ["+ /divergences/marks"] if layout.has_divergences else []
    views = [
        rrb.TimeSeriesView(
            name=title,
            contents=[*(f"+ {line.entity}" for line in lines), *(marks if lines[0].unit != "kg" else [])],
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
            axis_x=_time_axis(rrb, layout),
        )
        for title, lines in plots(layout.lines, layout.changed_flags).items()
    ]
    if len(views) <= MAX_PLOTS_BESIDE:
        return rrb.Vertical(*views) if views else None
    first, rest = views[: MAX_PLOTS_BESIDE - 1], views[MAX_PLOTS_BESIDE - 1 :]
    return rrb.Vertical(*first, rrb.Tabs(*rest))
