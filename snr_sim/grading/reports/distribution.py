"""A picture of the class: how many got how many points, and how many got all of each check."""

from __future__ import annotations

import statistics
from pathlib import Path

from snr_sim.grading.reports.class_table import Summary
from snr_sim.grading.reports.feedback import number
from snr_sim.prelude.text import one_line
from snr_sim.view.picture_sheet import Area, Rgb, Sheet, color, picture

_BINS = 10
_WIDTH, _MARGIN, _TOP, _BARS_HEIGHT, _ROW_HEIGHT = 640, 40, 74, 180, 22
_PAPER: Rgb = (255, 255, 255)
_INK: Rgb = (40, 44, 52)
_FAINT: Rgb = (226, 229, 234)
_BAR: Rgb = (74, 120, 170)
_MEAN: Rgb = (200, 80, 50)


def draw_distribution(summary: Summary, title: str, path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    checks_top = _TOP + _BARS_HEIGHT + 64
    with picture(path, _WIDTH, checks_top + _ROW_HEIGHT * len(summary.checks) + 24, _PAPER) as sheet:
        sheet.text((_MARGIN, 16), sheet.cut(one_line(title), 13, _WIDTH - 2 * _MARGIN), 13, _INK)
        sheet.text((_MARGIN, 38), summary.sentence(), 9, _INK)
        _draw_bars(sheet, summary, (_MARGIN, _TOP, _WIDTH - _MARGIN, _TOP + _BARS_HEIGHT))
        sheet.text((_MARGIN, checks_top - 20), "how many got all points of", 10, _INK)
        for i, (name, count) in enumerate(summary.checks.items()):
            _draw_row(sheet, checks_top + i * _ROW_HEIGHT, name, count, max(1, len(summary.points)))


def bins(points: list[float], max_points: float) -> list[int]:
    """Return how many have how much, in tenths of all points; those with all are in the last.

    >>> bins([0, 9.9, 10, 95, 100], 100)
    [2, 1, 0, 0, 0, 0, 0, 0, 0, 2]
    """
    counts = [0] * _BINS
    for one in points:
        counts[min(_BINS - 1, max(0, int(_BINS * one / max_points)))] += 1
    return counts


def _draw_bars(sheet: Sheet, summary: Summary, area: Area) -> None:
    max_points, counts = summary.max_points or 1.0, bins(summary.points, summary.max_points or 1.0)
    axes = sheet.axes(area, (0.0, max_points), (0.0, 1.1 * max(1, *counts)))
    edges = [max_points * i / _BINS for i in range(_BINS + 1)]
    bars = axes.bar(edges[:-1], counts, 0.92 * max_points / _BINS, align="edge", color=color(_BAR))
    axes.bar_label(bars, [str(count or "") for count in counts], padding=2, size=9, color=color(_INK))
    axes.axhline(0.0, color=color(_INK), linewidth=1.0, clip_on=False)
    axes.set_xticks(edges, [number(i * (summary.max_points or 100) / _BINS) for i in range(_BINS + 1)])
    axes.tick_params(length=0, pad=6, labelsize=8, labelcolor=color(_INK))
    axes.set_xlabel("points", size=9, color=color(_INK))
    if summary.points:
        mean = statistics.fmean(summary.points)
        axes.axvline(mean, color=color(_MEAN), linewidth=1.2, linestyle=(0, (4, 4)))
        axes.text(mean, 1.01, "mean", transform=axes.get_xaxis_transform(), size=8, color=color(_MEAN), ha="center")


def _draw_row(sheet: Sheet, top: float, name: str, count: int, total: int) -> None:
    middle, left, right = top + _ROW_HEIGHT / 2, _WIDTH * 0.6, _WIDTH - _MARGIN - 60
    sheet.text((_MARGIN, middle), sheet.cut(one_line(name), 9, left - _MARGIN - 12), 9, _INK, "lm")
    axes = sheet.axes((left, middle - 5, right, middle + 5), (0.0, total), rgb=_FAINT)
    axes.barh(0.5, count, 1.0, color=color(_BAR))
    sheet.text((right + 8, middle), f"{count} of {total}", 8, _INK, "lm")
