"""Small plots over time for pictures: few ticks, no boxes, names written in the colour of their line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from snr_sim.recording.columns import Floats
from snr_sim.view.picture_layout import Labels
from snr_sim.view.picture_sheet import BACKGROUND, EVENT, FAINT, GRID, PALE, Area, Point, Rgb, Sheet, color

COLORS: tuple[Rgb, ...] = (
    (110, 190, 250), (255, 150, 90), (130, 220, 150), (225, 150, 235),
    (240, 220, 110), (120, 220, 215), (250, 130, 140), (180, 180, 190),
)  # fmt: skip


class Plot(NamedTuple):
    """Some lines over time."""

    unit: str  # of the values, as text
    lines: list[tuple[str, Floats, Floats]]  # name, times [s] and values of each
    min_span: float = 1e-9  # minimum span of the scale, so that noise does not fill it
    is_down: bool = False  # whether larger values are lower, as for depth
    relative_height: float = 1.0
    first_color: int = 0  # index in COLORS for its first line


def draw_plots(
    sheet: Sheet,
    area: Area,
    plots: Sequence[Plot],
    events_s: Sequence[float],
    are_numbered: bool = False,
    begin_s: float = 0.0,
) -> None:
    """Draw plots below each other over a common time axis, which begins at `begin_s`.

    The moments `events_s` are marked, with numbers from 1 if `are_numbered`.
    """
    if not plots:
        return
    left, top, right, bottom = area
    left += 34
    unit_height = (bottom - top) / sum(plot.relative_height for plot in plots)
    end_s = max((float(times[-1]) for plot in plots for _, times, _ in plot.lines if len(times)), default=1.0) or 1.0
    points_per_s = (right - left) / (end_s - begin_s)
    at = top
    for plot in plots:
        height = plot.relative_height * unit_height
        _draw_names(sheet, plot, left, at + 2)
        low, high = span(plot)
        axes = sheet.axes((left, at + 20, right, at + height - 8), (begin_s, end_s), (low, high))
        if plot.is_down:
            axes.invert_yaxis()
        axes.grid(axis="y", color=color(GRID), linewidth=0.7, clip_on=False)
        sheet.scale(axes.yaxis, 4)
        for event_s in events_s:
            axes.axvline(event_s, ymax=1.03, color=color(EVENT), linewidth=1.0, linestyle=(0, (3, 3)), clip_on=False)
        for i, (_, times, values) in enumerate(plot.lines):
            axes.plot(times, values, color=color(_color(plot, i)), linewidth=1.4, clip_on=False)
        at += height
    sheet.scale(axes.xaxis, 7, 0.0, 12.0 / points_per_s)
    axes.tick_params(axis="x", pad=6.0)
    sheet.text((right, bottom - 2), "s", 9.0, PALE, "rt")
    marks = Labels([], 0.0, (left - 34, top, right + 6.0, bottom))
    for number, event_s in enumerate(events_s if are_numbered else (), 1):
        x = left + points_per_s * (event_s - begin_s)
        spot = marks.find_free([(x - 6.0, top + 22.0 + 13.0 * i) for i in range(len(events_s))], 12.0, 12.0)
        draw_number(sheet, (x, spot[1] if spot else top + 22.0), number)


def draw_number(sheet: Sheet, at: Point, number: int) -> None:
    """Draw a number in a circle, the mark of a moment."""
    disc = {"boxstyle": "circle,pad=0.16", "facecolor": color(EVENT), "edgecolor": "none"}
    sheet.text(at, str(number), 8.0, BACKGROUND, "mm", bbox=disc)


def _color(plot: Plot, place: int) -> Rgb:
    return COLORS[(plot.first_color + place) % len(COLORS)]


def _draw_names(sheet: Sheet, plot: Plot, x: float, y: float) -> None:
    for i, (name, _, _) in enumerate(plot.lines):
        sheet.text((x, y), name, 10.5, _color(plot, i))
        x += sheet.text_width(name, 10.5) + 8
    sheet.text((x, y + 1), plot.unit, 9.5, FAINT)


def span(plot: Plot) -> tuple[float, float]:
    """Return minimum and maximum of a plot's scale; one of them is zero if zero is near."""
    finite = np.concatenate([values[np.isfinite(values)] for _, _, values in plot.lines] or [np.zeros(1)])
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    low, high = min(low, 0.0) if low < 0.35 * high else low, max(high, 0.0) if high < 0 else high
    min_span = max(plot.min_span, 1e-9)
    if high - low < 1e-9:
        min_span = max(min_span, 1.0)
    if high - low < min_span:
        low, high = (low + high - min_span) / 2, (low + high + min_span) / 2
    return low, high
