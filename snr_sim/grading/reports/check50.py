"""JSON in the shape of check50's, for tools that show such results."""

from __future__ import annotations

import json
from typing import Any

from snr_sim.grading.reports import feedback
from snr_sim.grading.reports.plain import one_line, plain
from snr_sim.grading.reports.results import CheckResult, Graded


def check50(graded: Graded) -> str:
    """Return the file's text; it has `error` instead of `results` if no check was run."""
    fields: dict[str, Any] = {"slug": one_line(graded.lab), "version": graded.version}
    if graded.status == "graded":
        fields["results"] = [_result(check) for check in graded.checks]
    else:
        words = graded.error if graded.status == "rejected" else feedback.headline(graded)
        fields["error"] = {"type": graded.status, "value": plain(words)}
    return json.dumps(fields, indent=1, ensure_ascii=True) + "\n"


def _result(check: CheckResult) -> dict[str, Any]:
    outcome = feedback.verdict(check)
    cause = None
    if outcome != "passed":
        wrong = feedback.first_wrong(check)
        cause = {"rationale": feedback.main_hint(check), "help": "\n".join(feedback.hidden_lines(check)) or None}
        if wrong is not None:
            cause |= {"expected": plain(wrong.expected, 1000), "actual": plain(wrong.actual or wrong.error, 1000)}
    return {
        "name": check.name,
        "description": one_line(check.title),
        "passed": None if outcome == "skipped" else outcome == "passed",
        "log": feedback.as_text(check).split("\n"),
        "cause": cause,
        "data": {"points": check.points, "max_points": check.max_points},
        "dependency": None,
    }
