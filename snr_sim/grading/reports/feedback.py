"""Feedback on a check for the student: all of visible cases; of hidden ones the number that passed, and the hints.

Every report uses this module, so none reveals more of a hidden case than another: not its input, not its seed, and not
what the student's program printed or did in it, which could contain the input.
"""

from __future__ import annotations

from collections import Counter

from snr_sim.grading.reports.results import CaseResult, CheckResult, Graded
from snr_sim.prelude.text import one_line, plain

_MAX_CASES = 60


def verdict(check: CheckResult) -> str:
    """Return "passed", "failed", "partly" or "skipped"."""
    if check.skipped_because:
        return "skipped"
    if check.is_passed:
        return "passed"
    return "partly" if check.points > 0 else "failed"


def number(value: float) -> str:
    """Return points as people write them.

    >>> number(12.5), number(20.0), number(6.6666667)
    ('12.5', '20', '6.67')
    """
    return f"{value:.2f}".rstrip("0").rstrip(".")


def visible(check: CheckResult) -> tuple[CaseResult, ...]:
    """Return the cases of which everything may be shown."""
    return tuple(case for case in check.cases if case.is_visible)


def hidden_lines(check: CheckResult) -> list[str]:
    """Return the feedback on the hidden cases: one line for all, and one for each different hint."""
    hidden = [case for case in check.cases if not case.is_visible]
    if not hidden:
        return []
    passed = sum(case.is_passed for case in hidden)
    hints = Counter(one_line(case.hint) for case in hidden if not case.is_passed and case.hint)
    hint_lines = [f"{count} x: {hint}" for hint, count in hints.most_common()]
    return [f"Hidden cases: {passed} of {len(hidden)} passed.", *hint_lines]


def first_wrong(check: CheckResult) -> CaseResult | None:
    """Return the first visible case that is not all right, if there is one."""
    return next((case for case in visible(check) if not case.is_passed), None)


def main_hint(check: CheckResult) -> str:
    """Return the one thing to think about first."""
    wrong = next((case for case in check.cases if not case.is_passed and case.hint), None)
    return one_line(wrong.hint) if wrong else check.skipped_because


def parts(case: CaseResult) -> list[tuple[str, str]]:
    """Return the feedback on a visible case, each part with its heading."""
    texts = [("expected", case.expected), ("found", case.actual), ("went wrong", case.error)]
    return [(heading, text) for heading, text in [*texts, ("your program printed", case.printed)] if text]


def as_text(check: CheckResult) -> str:
    """Return a check in plain text, for systems that show it unchanged."""
    if check.skipped_because:
        return f"Not tried: {one_line(check.skipped_because)}"
    lines = []
    for case in visible(check)[:_MAX_CASES]:
        name = one_line(case.label) or "case"
        hint = f": {one_line(case.hint)}" if case.hint else ""
        mark = "passed" if case.is_passed else "partly" if case.fraction > 0 else "failed"
        lines.append(f"[{mark}] {name}{hint}")
        if not case.is_passed:
            lines += [f"    {heading}: {plain(text, 2000)}".replace("\n", "\n      ") for heading, text in parts(case)]
    return "\n".join([*lines, *hidden_lines(check)])


def headline(graded: Graded) -> str:
    """Return the mark in a sentence."""
    if graded.points is None:
        return "Not graded: the grader failed, not you."
    words = f"{number(graded.points)} of {number(graded.max_points)} points."
    return f"{words} Nothing could be graded." if graded.status == "rejected" else words
