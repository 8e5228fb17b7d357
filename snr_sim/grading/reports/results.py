"""Result of grading a submission: the one record from which every report is made.

    lab, submission, secret -> checks, one child per case -> Graded -> Markdown, Gradescope, JUnit, check50, CSV

Nothing in it depends on when or how fast it was graded: the same submission, lab and secret give the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

import msgspec
from msgspec.structs import replace

Status: TypeAlias = Literal["graded", "rejected", "grader_error"]
Isolation: TypeAlias = Literal["sandbox", "confined", "none"]
RequestedIsolation: TypeAlias = Literal["required", "none"]
Order: TypeAlias = Literal["asc", "desc"]

FULL_POINTS = 100.0


class CaseResult(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One case of a check.

    Of a hidden case a student sees `fraction` and `hint`, and nothing else: the other texts may hold what the
    student's program made of its input, or said about it.

    Args:
        label: subject of the case, such as "from 1 m to 3 m".
        is_visible: whether `snr check` shows it, too.
        fraction: how much of the case was right, 0 to 1.
        hint: what to think about next, from the lab or the grader; contains nothing of the student's program.
        expected: the right result.
        actual: the result obtained.
        error: the failure of the student's program, the student's own line first: an exception, a late answer.
        printed: output of the student's program, truncated.
        metrics: numbers for the class's table and the leaderboard.
        fault: where the check gave up on a result of the student's program, which is 0; for the instructor alone.
        run_folder: the recorded run, relative to the folder of the submission's results; empty if none was kept.
    """

    label: str
    is_visible: bool
    fraction: float
    hint: str = ""
    expected: str = ""
    actual: str = ""
    error: str = ""
    printed: str = ""
    metrics: dict[str, float] = {}
    fault: str = ""
    run_folder: str = ""

    @property
    def is_passed(self) -> bool:
        """Whether all of it was right."""
        return self.fraction >= 1.0


class CheckResult(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One check: its name, its points, and its cases in order.

    Args:
        name: the name of the check's function.
        title: the first line of its docstring.
        points: points obtained.
        max_points: maximum points.
        cases: visible ones first; empty if it was skipped.
        skipped_because: why it was skipped, as text; empty if it was not.
    """

    name: str
    title: str
    points: float
    max_points: float
    cases: tuple[CaseResult, ...] = ()
    skipped_because: str = ""

    @property
    def is_passed(self) -> bool:
        """Whether it was tried, and all its points were given."""
        return not self.skipped_because and self.points >= self.max_points


class Graded(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A submission with its checks.

    Args:
        submission: its name in every report.
        lab: name of the lab's folder.
        title: of the lab.
        checks: in the lab's order; empty unless `status` is "graded".
        isolation: of the student's program: in a "sandbox" of namespaces; "confined" by the kernel's other
            mechanisms, in a container where namespaces are not permitted; or "none".
        includes_hidden: whether hidden cases were tried: in grading, not in practice.
        version: of snr_sim.
        status: "graded"; "rejected": the submission has nothing that can be graded, 0 points; "grader_error": the
            lab or the grader failed, which gives no grade.
        error: why it was refused, for the student, or what the fault was, for the instructor.
        notes: further information for the student: files that were left out, or are missing.
        leaderboard: which of `metrics` are ranked, and whether "asc" (the smallest is best) or "desc".
    """

    submission: str
    lab: str
    title: str
    checks: tuple[CheckResult, ...] = ()
    isolation: Isolation
    includes_hidden: bool
    version: str
    status: Status = "graded"
    error: str = ""
    notes: tuple[str, ...] = ()
    leaderboard: dict[str, Order] = {}

    @property
    def max_points(self) -> float:
        """Points of all checks together that could be had; 100 if none was tried."""
        return round(sum(check.max_points for check in self.checks), 6) if self.checks else FULL_POINTS

    @property
    def points(self) -> float | None:
        """Points of all checks together; None if there is no mark, because the lab or the grader failed."""
        return None if self.status == "grader_error" else round(sum(check.points for check in self.checks), 6)

    @property
    def faults(self) -> list[str]:
        """Cases in which a check gave up on a result of the student's program: 0 points; for the instructor to see."""
        return [
            f"{check.name}, case '{case.label}': {case.fault}"
            for check in self.checks
            for case in check.cases
            if case.fault
        ]

    @property
    def metrics(self) -> dict[str, float]:
        """Returns each metric's mean over the cases that have it, by `<check>.<metric>`."""
        found: dict[str, list[float]] = {}
        for check in self.checks:
            for case in check.cases:
                for name, value in case.metrics.items():
                    found.setdefault(f"{check.name}.{name}", []).append(value)
        return {name: sum(values) / len(values) for name, values in found.items()}


def with_runs_named(graded: Graded, name: Callable[[str], str]) -> Graded:
    """Return the result with another name for the folder of each recorded run; "" for one that is not handed out."""
    checks = []
    for check in graded.checks:
        cases = (replace(case, run_folder=name(case.run_folder)) if case.run_folder else case for case in check.cases)
        checks.append(replace(check, cases=tuple(cases)))
    return replace(graded, checks=tuple(checks))


def encode_graded(graded: Graded) -> bytes:
    """Return the record as JSON, in one line with its end; the same record gives the same bytes."""
    return msgspec.json.encode(graded, order="deterministic") + b"\n"


def decode_graded(text: bytes) -> Graded:
    """Return a record of JSON; msgspec's DecodeError or ValidationError is raised if it is not one."""
    return _decode(text)


# Made once, here: what msgspec learns of a type when it is first used, two threads may not learn at once: 0.22 crashes.
_decode = msgspec.json.Decoder(Graded).decode
