"""Tables of a class: a row per submission for spreadsheets, a row per case for details, and the ranking.

Rows are written one by one, and only the numbers of each submission are kept in memory, for classes of any size.
"""

from __future__ import annotations

import csv
import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TextIO, TypeAlias

from snr_sim.grading.reports.feedback import number
from snr_sim.grading.reports.plain import cell
from snr_sim.grading.reports.results import Graded, Order

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
    """Write one row per submission.

    Args:
        table: opened with newline="".
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
        writer.writerows(_case_rows(graded))


def _case_rows(graded: Graded) -> Iterator[list[str]]:
    for check in graded.checks:
        for case in check.cases:
            texts = (case.hint, case.expected, case.actual or case.error)
            metrics = " ".join(f"{name}={value:.6g}" for name, value in sorted(case.metrics.items()))
            fraction = f"{case.fraction:.4g}"
            start = [
                cell(graded.submission),
                check.name,
                cell(case.label),
                "yes" if case.is_visible else "no",
                fraction,
            ]
            yield [*start, *map(cell, texts), cell(metrics)]


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
