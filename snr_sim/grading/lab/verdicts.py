"""Verdict of a check for one case: right, wrong, or partly right; with a hint for the student."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from snr_sim.prelude.errors import SnrError

ENDED_EARLY = (
    "Your program ended the run by itself, with tasks.terminate or tasks.finish, before it was over. Continue until "
    "the run ends, whatever has been reached."
)


@dataclass(frozen=True)
class CheckVerdict:
    """Result of one case.

    Args:
        fraction: how much of it was right, 0 to 1.
        hint: what to think about next. The student sees this for hidden cases, too: it must not reveal the case.
        expected: the right result.
        actual: the result obtained.
        metrics: numbers for the class's table and the leaderboard.
    """

    fraction: float
    hint: str = ""
    expected: str = ""
    actual: str = ""
    metrics: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (isinstance(self.fraction, (int, float)) and 0.0 <= self.fraction <= 1.0):
            raise InconclusiveError(
                f"fraction of a verdict must be from 0 to 1, not {self.fraction!r}.",
                fix="return passed(), failed(...) or partial_credit(...).",
            )
        for name, value in self.metrics.items():
            if not isinstance(value, (int, float)) or not -math.inf < value < math.inf:
                raise InconclusiveError(
                    f"The metric {name} of a verdict must be finite, not {value!r}.",
                    fix="leave out a metric that was not reached.",
                )


def passed(note: str = "", metrics: Mapping[str, float] | None = None) -> CheckVerdict:
    """Return the verdict of a case that is all right."""
    return CheckVerdict(1.0, hint=note, metrics=metrics or {})


def failed(hint: str, expected: str = "", actual: str = "", metrics: Mapping[str, float] | None = None) -> CheckVerdict:
    """Return the verdict of a case that is wrong."""
    return CheckVerdict(0.0, hint, expected, actual, metrics or {})


def partial_credit(
    fraction: float, hint: str, expected: str = "", actual: str = "", metrics: Mapping[str, float] | None = None
) -> CheckVerdict:
    """Return the verdict of a case of which a fraction is right, clamped to 0 to 1."""
    return CheckVerdict(min(1.0, max(0.0, fraction)), hint, expected, actual, metrics or {})


class GraderError(SnrError):
    """The lab, or the grader, has failed: no fault of the student's, and no mark."""


class InconclusiveError(GraderError):
    """The lab could not judge a case: a fault of the lab, unless the student's program may have caused it."""


class SubmissionError(SnrError):
    """The student's program did something that no check can evaluate: it raised, or its answer was invalid or missing.

    Args:
        message: what happened, with the student's own line first. It may contain output of the program.
        hint: what to think about, without anything of the program's: it is shown for hidden cases, too.
        expected: the right result.
        actual: the result obtained.
    """

    def __init__(self, message: str, hint: str, expected: str = "", actual: str = "") -> None:
        super().__init__(message)
        self.hint: str = hint
        self.expected: str = expected
        self.actual: str = actual
