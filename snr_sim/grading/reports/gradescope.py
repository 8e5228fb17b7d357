"""results.json as Gradescope reads it: one test per check, all visible, without details of hidden cases.

No test's visibility is "hidden": Gradescope then hides the total, too. What must not be seen is not in the file.

Source: "Autograder Specifications", gradescope-autograders.readthedocs.io.
"""

from __future__ import annotations

import json
from typing import Any

from snr_sim.grading.reports import feedback
from snr_sim.grading.reports.plain import one_line, plain
from snr_sim.grading.reports.results import CheckResult, Graded
from snr_sim.grading.reports.student_page import FAULT

_MAX_OUTPUT_CHARS = 20_000


def gradescope_results(graded: Graded) -> str:
    """Return the file's text. After a fault it has no score, so that Gradescope reports an error and no mark."""
    return json.dumps(_fields(graded), indent=1, ensure_ascii=True) + "\n"


def _fields(graded: Graded) -> dict[str, Any]:
    lines = [feedback.headline(graded)]
    if graded.status == "grader_error":
        lines.append(FAULT)
    elif graded.error:
        lines.append(plain(graded.error))
    if graded.isolation == "none":
        lines.append("The program was not kept apart from the grader.")
    fields: dict[str, Any] = {
        "output": "\n".join([*lines, *(one_line(note) for note in graded.notes)]),
        "output_format": "text",
        "test_output_format": "text",
        "test_name_format": "text",
        "visibility": "visible",
        "stdout_visibility": "hidden",
        "extra_data": {
            "status": graded.status,
            "isolation": graded.isolation,
            "version": graded.version,
            "lab": graded.lab,
        },
        "tests": [_test(i, check) for i, check in enumerate(graded.checks, 1)],
    }
    if graded.points is not None:
        fields["score"] = graded.points
    metrics = graded.metrics
    fields["leaderboard"] = [
        {"name": one_line(name), "value": metrics[name], "order": order}
        for name, order in graded.leaderboard.items()
        if name in metrics
    ]
    return fields


def _test(number: int, check: CheckResult) -> dict[str, Any]:
    return {
        "name": one_line(check.title),
        "number": str(number),
        "score": check.points,
        "max_score": check.max_points,
        "status": "passed" if check.is_passed else "failed",
        "output": feedback.as_text(check)[:_MAX_OUTPUT_CHARS],
        "visibility": "visible",
        "tags": [check.name],
    }
