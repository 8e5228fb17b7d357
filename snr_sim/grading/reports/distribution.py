"""A picture of the class: how many got how many points, and how many got all of each check."""

from __future__ import annotations

import statistics
from pathlib import Path

from snr_sim.grading.reports.class_table import Summary
from snr_sim.grading.reports.plain import one_line
from snr_sim.grading.reports.told import number
from snr_sim.view.picture_canvas import Canvas, Rgb

_BINS = 10
_WIDTH, _MARGIN, _BARS_HEIGHT, _ROW_HEIGHT = 640, 40, 190, 22
_PAPER: Rgb = (255, 255, 255)
_INK: Rgb = (40, 44, 52)
_FAINT: Rgb = (226, 229, 234)
_BAR: Rgb = (74, 120, 170)
_MEAN: Rgb = (200, 80, 50)


def draw_distribution(summary: Summary, title: str, path: Path) -> None:
    """Writes the picture as PNG.

    Raises:
        MissingExtra: Pillow is not installed.
    """
    rows = list(summary.checks.items())
    top = 64
    checks_top = top + _BARS_HEIGHT + 64
    canvas = Canvas(_WIDTH, checks_top + _ROW_HEIGHT * len(rows) + 24, _PAPER)
    canvas.text((_MARGIN, 16), canvas.cut(one_line(title), 15, _WIDTH - 2 * _MARGIN), 15, _INK)
    canvas.text((_MARGIN, 38), summary.words(), 10, _INK)
    _draw_bars(canvas, summary, top)
    canvas.text((_MARGIN, checks_top - 20), "how many got all points of", 11, _INK)
    for i, (name, count) in enumerate(rows):
        _draw_row(canvas, checks_top + i * _ROW_HEIGHT, name, count, max(1, len(summary.points)))
    canvas.save(path)


def bins(points: list[float], of: float) -> list[int]:
    """Returns how many have how much, in tenths of all points; those with all are in the last.

    >>> bins([0, 9.9, 10, 95, 100], 100)
    [2, 1, 0, 0, 0, 0, 0, 0, 0, 2]
    """
    counts = [0] * _BINS
    for one in points:
        counts[min(_BINS - 1, max(0, int(_BINS * one / of)))] += 1
    return counts


def _draw_bars(canvas: Canvas, summary: Summary, top: float) -> None:
    counts = bins(summary.points, summary.of or 1.0)
    most = max(1, *counts)
    width = (_WIDTH - 2 * _MARGIN) / _BINS
    base = top + _BARS_HEIGHT
    for i, count in enumerate(counts):
        left = _MARGIN + i * width
        height = (_BARS_HEIGHT - 20) * count / most
        canvas.rectangle(left + 2, base - height, left + width - 2, base, _BAR)
        if count:
            canvas.text((left + width / 2, base - height - 3), str(count), 10, _INK, anchor="mb")
        canvas.text((left, base + 6), number(i * (summary.of or 100) / _BINS), 9, _INK, anchor="ma")
    canvas.text((_WIDTH - _MARGIN, base + 6), number(summary.of or 100), 9, _INK, anchor="ma")
    canvas.line([(_MARGIN, base), (_WIDTH - _MARGIN, base)], _INK)
    canvas.text((_WIDTH / 2, base + 20), "points", 10, _INK, anchor="ma")
    if summary.points:
        x = _MARGIN + (_WIDTH - 2 * _MARGIN) * statistics.fmean(summary.points) / (summary.of or 1.0)
        canvas.dashed((x, top), (x, base), _MEAN, 1.2)
        canvas.text((x, top - 2), "mean", 9, _MEAN, anchor="mb")


def _draw_row(canvas: Canvas, top: float, name: str, count: int, total: int) -> None:
    middle, left = top + _ROW_HEIGHT / 2, _WIDTH * 0.6
    right = _WIDTH - _MARGIN - 60
    canvas.text((_MARGIN, middle), canvas.cut(one_line(name), 10, left - _MARGIN - 12), 10, _INK, anchor="lm")
    canvas.rectangle(left, middle - 5, right, middle + 5, _FAINT)
    if count:
        canvas.rectangle(left, middle - 5, left + (right - left) * count / total, middle + 5, _BAR)
    canvas.text((right + 8, middle), f"{count} of {total}", 9, _INK, anchor="lm")
