"""Small plots over time for `picture.py`: few ticks, no boxes, names written in the colour of their line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from snr_sim.recording.columns import Floats
from snr_sim.view.picture_canvas import Canvas, Rgb
from snr_sim.view.picture_layout import Labels

BACKGROUND: Rgb = (20, 24, 36)
INK: Rgb = (240, 242, 246)
PALE: Rgb = (176, 184, 198)
FAINT: Rgb = (96, 106, 124)
GRID: Rgb = (44, 51, 68)
EVENT: Rgb = (255, 200, 80)
COLORS: tuple[Rgb, ...] = ((110, 190, 250), (255, 150, 90), (130, 220, 150), (225, 150, 235))
POINTS_MAX = 600  # more than there are pixels


class Plot(NamedTuple):
    """Some lines over time.

    Args:
        title: of the plot.
        lines: name, times [s] and values of each.
        least: how much the scale spans at the least, so that noise does not fill it.
        is_down: whether more is lower, as with depth.
        share: how high it is beside others.
        first_color: of COLORS, for its first line.
    """

    title: str
    lines: list[tuple[str, Floats, Floats]]
    least: float = 1e-9
    is_down: bool = False
    share: float = 1.0
    first_color: int = 0


def draw_plots(
    canvas: Canvas,
    area: tuple[float, float, float, float],
    plots: Sequence[Plot],
    events_s: Sequence[float],
    are_numbered: bool = False,
    begin_s: float = 0.0,
) -> None:
    """Draws plots below each other over the same time.

    Args:
        canvas: to draw on.
        area: left, top, right and bottom in points.
        plots: from top to bottom.
        events_s: moments to mark.
        are_numbered: whether they have numbers, from 1.
        begin_s: time at the left edge.
    """
    if not plots:
        return
    left, top, right, bottom = area
    unit_height = (bottom - top) / sum(plot.share for plot in plots)
    end_s = max((float(times[-1]) for plot in plots for _, times, _ in plot.lines if len(times)), default=1.0) or 1.0
    at = top
    for plot in plots:
        height = plot.share * unit_height
        _draw_names(canvas, plot, left + 34, at)
        _draw_plot(canvas, (left + 34, at + 20, right, at + height - 8), plot, (begin_s, end_s), events_s)
        at += height
    marks = Labels([], 0.0, (left, top, right + 6.0, bottom))
    for number, event_s in enumerate(events_s if are_numbered else (), 1):
        x = left + 34 + (right - left - 34) * (event_s - begin_s) / (end_s - begin_s)
        spot = marks.place([(x - 6.0, top + 22.0 + 13.0 * i) for i in range(len(events_s))], 12.0, 12.0)
        draw_number(canvas, (x, spot[1] if spot else top + 22.0), number)
    for t in ticks(begin_s, end_s, count=5):
        x = left + 34 + (right - left - 34) * (t - begin_s) / (end_s - begin_s)
        if x < right - 12:
            canvas.text((x, bottom - 2), f"{t:g}", 10.0, PALE, "ma")
    canvas.text((right, bottom - 2), "s", 10.0, PALE, "ra")


def draw_number(canvas: Canvas, at: tuple[float, float], number: int) -> None:
    """Draws a number in a circle: the mark of a moment."""
    canvas.disc(at, 5.6, EVENT)
    canvas.text(at, str(number), 9.0, BACKGROUND, "mm")


def _color(plot: Plot, place: int) -> Rgb:
    return COLORS[(plot.first_color + place) % len(COLORS)]


def _unit(title: str) -> str:
    return title[title.index("[") :] if "[" in title else ""


def _draw_names(canvas: Canvas, plot: Plot, x: float, y: float) -> None:
    for i, (name, _, _) in enumerate(plot.lines):
        canvas.text((x, y), name, 11.5, _color(plot, i))
        x += canvas.text_width(name, 11.5) + 8
    canvas.text((x, y + 1), _unit(plot.title), 10.5, FAINT)


def _draw_plot(
    canvas: Canvas,
    panel: tuple[float, float, float, float],
    plot: Plot,
    span_s: tuple[float, float],
    events_s: Sequence[float],
) -> None:
    left, top, right, bottom = panel
    begin_s, end_s = span_s
    finite = np.concatenate([values[np.isfinite(values)] for _, _, values in plot.lines] or [np.zeros(1)])
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    low, high = min(low, 0.0) if low < 0.35 * high else low, max(high, 0.0) if high < 0 else high
    if high - low < 1e-9:
        low, high = low - 0.5, high + 0.5
    if high - low < plot.least:
        low, high = (low + high - plot.least) / 2, (low + high + plot.least) / 2
    at_low, at_high = (top, bottom) if plot.is_down else (bottom, top)
    marks = ticks(low, high, count=3)
    for value in marks if len(marks) > 1 else ticks(low, high, count=6):
        y = at_low + (value - low) / (high - low) * (at_high - at_low)
        canvas.line([(left, y), (right, y)], GRID, 0.7)
        canvas.text((left - 5, y), f"{value:g}", 10.0, PALE, "rm")
    for event_s in events_s:
        x = left + (right - left) * (event_s - begin_s) / (end_s - begin_s)
        canvas.dashed((x, top - 2), (x, bottom), EVENT, 1.0, 3.0)
    for i, (_, times, values) in enumerate(plot.lines):
        step = max(1, len(times) // POINTS_MAX)
        xs = left + (right - left) * (times[::step] - begin_s) / (end_s - begin_s)
        ys = at_low + (values[::step] - low) / (high - low) * (at_high - at_low)
        for part in _finite_parts(xs, ys):
            canvas.line(part, _color(plot, i), 1.4)


def _finite_parts(xs: Floats, ys: Floats) -> list[list[tuple[float, float]]]:
    """Returns the points between gaps: where a value is not a number, the line has a hole."""
    parts: list[list[tuple[float, float]]] = [[]]
    for x, y in zip(xs.tolist(), ys.tolist(), strict=True):
        if math.isfinite(y):
            parts[-1].append((x, y))
        elif parts[-1]:
            parts.append([])
    return parts


def ticks(low: float, high: float, count: int) -> list[float]:
    """Returns about `count` round numbers from `low` to `high`.

    >>> ticks(0.0, 45.2, 5)
    [0.0, 10.0, 20.0, 30.0, 40.0]
    """
    if not high > low:
        return [low]
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= 0.7 * rough)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [round(i * step, 9) for i in range(first, last + 1)]
