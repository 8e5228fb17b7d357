"""Reports on a class: a row per submission for spreadsheets, a row per case, the ranking, and a picture of the points.

Rows are written one by one, and only the numbers of each submission are kept in memory, for classes of any size.
"""

from __future__ import annotations

import csv
import statistics
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO, TypeAlias

from snr_sim.grading.reports.feedback import number
from snr_sim.grading.reports.results import Graded, Order
from snr_sim.prelude.text import one_line
from snr_sim.view.picture_sheet import Area, Rgb, Sheet, color, picture

_FORMULA = ("=", "+", "-", "@", "\t", "|", "%")
_BINS = 10
_WIDTH, _MARGIN, _TOP, _BARS_HEIGHT, _ROW_HEIGHT = 640, 40, 74, 180, 22
_PAPER: Rgb = (255, 255, 255)
_INK: Rgb = (40, 44, 52)
_FAINT: Rgb = (226, 229, 234)
_BAR: Rgb = (74, 120, 170)
_MEAN: Rgb = (200, 80, 50)
ReadAll: TypeAlias = Callable[[], Iterable[Graded]]


@dataclass
class Summary:
    """A class in numbers, and in names of submissions."""

    points: list[float] = field(default_factory=list)  # of each submission that has a mark
    max_points: float = 0.0
    rejected: list[str] = field(default_factory=list)  # could not be graded
    grader_errors: list[str] = field(default_factory=list)  # have no mark
    unjudged: list[str] = field(default_factory=list)  # have a mark, but some case could not be judged
    checks: dict[str, int] = field(default_factory=dict)  # how many got all points of each check, by its title
    ranked: dict[str, list[tuple[float, str]]] = field(default_factory=dict)  # of each ranked metric, unordered
    orders: dict[str, Order] = field(default_factory=dict)  # whether the least or the most is best

    def add(self, graded: Graded) -> None:
        """Count a submission."""
        if graded.points is None:
            self.grader_errors.append(graded.submission)
            return
        self.points.append(graded.points)
        self.max_points = max(self.max_points, graded.max_points)
        if graded.status == "rejected":
            self.rejected.append(graded.submission)
        if graded.faults:
            self.unjudged.append(graded.submission)
        for check in graded.checks:
            self.checks[check.title] = self.checks.get(check.title, 0) + check.is_passed
        metrics = graded.metrics
        for name, order in graded.leaderboard.items():
            self.orders[name] = order
            if name in metrics:
                self.ranked.setdefault(name, []).append((metrics[name], graded.submission))

    def sentence(self) -> str:
        """Return the class in a sentence."""
        if not self.points:
            return "No submission has a mark."
        return (
            f"{len(self.points)} graded: mean {number(statistics.fmean(self.points))}, median "
            f"{number(statistics.median(self.points))}, from {number(min(self.points))} to {number(max(self.points))} "
            f"of {number(self.max_points)} points."
        )


def write_class(table: TextIO, read_all: ReadAll, given: Mapping[str, str]) -> None:
    """Write one row per submission; the table was opened with newline="".

    Args:
        read_all: returns all submissions, each time it is called.
        given: where each submission was, by its name, to distinguish two of the same name.
    """
    checks: dict[str, None] = {}
    metrics: dict[str, None] = {}
    for graded in read_all():
        checks.update(dict.fromkeys(check.name for check in graded.checks))
        metrics.update(dict.fromkeys(graded.metrics))
    writer = csv.writer(table)
    writer.writerow(
        ["submission", "points", "max_points", "status", "isolation", *map(cell, (*checks, *metrics)), "error", "given"]
    )
    for graded in read_all():
        points = {check.name: check.points for check in graded.checks}
        measured = graded.metrics
        writer.writerow(
            [
                cell(graded.submission),
                "" if graded.points is None else number(graded.points),
                number(graded.max_points),
                graded.status,
                graded.isolation,
                *(number(points[name]) if name in points else "" for name in checks),
                *(f"{measured[name]:.6g}" if name in measured else "" for name in metrics),
                cell(graded.error or "\n".join(graded.faults)),
                cell(given.get(graded.submission, "")),
            ]
        )


def write_cases(table: TextIO, all_graded: Iterable[Graded]) -> None:
    """Write one row per case, hidden ones too: this table is the instructor's."""
    writer = csv.writer(table)
    writer.writerow(["submission", "check", "case", "visible", "fraction", "hint", "expected", "actual", "metrics"])
    for graded in all_graded:
        for check in graded.checks:
            for case in check.cases:
                start = (graded.submission, check.name, case.label, "yes" if case.is_visible else "no")
                metrics = " ".join(f"{name}={value:.6g}" for name, value in sorted(case.metrics.items()))
                texts = (f"{case.fraction:.4g}", case.hint, case.expected, case.actual or case.error, metrics)
                writer.writerow(map(cell, (*start, *texts)))


def write_leaderboard(table: TextIO, summary: Summary) -> None:
    """Write the ranking of each ranked metric; equal values share a place."""
    writer = csv.writer(table)
    writer.writerow(["metric", "place", "submission", "value"])
    for name, rows in summary.ranked.items():
        sign = -1.0 if summary.orders[name] == "desc" else 1.0
        rank, before = 0, None
        for i, (value, submission) in enumerate(sorted(rows, key=lambda row: (sign * row[0], row[1])), 1):
            rank, before = (rank, before) if value == before else (i, value)
            writer.writerow([cell(name), rank, cell(submission), f"{value:.6g}"])


def cell(text: str) -> str:
    """Return a text for a table's cell, which no spreadsheet reads as a formula.

    >>> cell("=1+1"), cell("ada"), cell(" \\t@x")
    ("'=1+1", 'ada', "'@x")
    """
    shown = one_line(text)
    return f"'{shown}" if shown.startswith(_FORMULA) else shown


def draw_distribution(summary: Summary, title: str, path: Path) -> None:
    """Write a picture as PNG: how many got how many points, and how many got all of each check.

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
