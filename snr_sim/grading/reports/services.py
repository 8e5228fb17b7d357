"""Results as other services read them: Gradescope, those that show JUnit's XML, and those that show check50's JSON.

In Gradescope's file there is one test per check, all visible, without details of hidden cases. No test's visibility is
"hidden": Gradescope then hides the total, too. What must not be seen is not in the file.

Source: "Autograder Specifications", gradescope-autograders.readthedocs.io.
"""

from __future__ import annotations

import json
from typing import Any
from xml.etree import ElementTree

from snr_sim.grading.reports import feedback
from snr_sim.grading.reports.results import CheckResult, Graded
from snr_sim.grading.reports.student_page import FAULT
from snr_sim.prelude.text import one_line, plain

_MAX_OUTPUT_CHARS = 20_000


def gradescope_results(graded: Graded) -> str:
    """Return Gradescope's results.json. After a fault it has no score, so that Gradescope reports an error, no mark."""
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
        "tests": [_gradescope_test(i, check) for i, check in enumerate(graded.checks, 1)],
    }
    if graded.points is not None:
        fields["score"] = graded.points
    metrics = graded.metrics
    fields["leaderboard"] = [
        {"name": one_line(name), "value": metrics[name], "order": order}
        for name, order in graded.leaderboard.items()
        if name in metrics
    ]
    return _json_text(fields)


def _gradescope_test(number: int, check: CheckResult) -> dict[str, Any]:
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


def junit(graded: Graded) -> str:
    """Return JUnit's XML, one test case per check. It has no times: the same submission gives the same file."""
    outcomes = [feedback.verdict(check) for check in graded.checks]
    is_graded = graded.status == "graded"
    suite = ElementTree.Element(
        "testsuite",
        name=f"{one_line(graded.title)}: {one_line(graded.submission)}",
        tests=str(len(outcomes) if is_graded else 1),
        failures=str(sum(outcome in ("failed", "partly") for outcome in outcomes)),
        errors=str(int(not is_graded)),
        skipped=str(outcomes.count("skipped")),
    )
    if not is_graded:
        case = ElementTree.SubElement(suite, "testcase", classname=one_line(graded.lab), name="grading")
        ElementTree.SubElement(case, "error", message=one_line(_error_of(graded)), type=graded.status)
    for check, outcome in zip(graded.checks, outcomes, strict=True):
        case = ElementTree.SubElement(suite, "testcase", classname=one_line(graded.lab), name=one_line(check.name))
        if outcome == "skipped":
            ElementTree.SubElement(case, "skipped", message=one_line(check.skipped_because))
        elif outcome != "passed":
            score = f"{feedback.number(check.points)} of {feedback.number(check.max_points)} points"
            failure = ElementTree.SubElement(
                case, "failure", message=f"{score}. {feedback.main_hint(check)}", type=outcome
            )
            failure.text = plain(feedback.as_text(check), _MAX_OUTPUT_CHARS)
    ElementTree.indent(suite)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(suite, encoding="unicode") + "\n"


def check50(graded: Graded) -> str:
    """Return JSON in the shape of check50's; it has `error` instead of `results` if no check was run."""
    fields: dict[str, Any] = {"slug": one_line(graded.lab), "version": graded.version}
    if graded.status == "graded":
        fields["results"] = [_check50_result(check) for check in graded.checks]
    else:
        fields["error"] = {"type": graded.status, "value": plain(_error_of(graded))}
    return _json_text(fields)


def _check50_result(check: CheckResult) -> dict[str, Any]:
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


def _error_of(graded: Graded) -> str:
    """Return why there are no results, for the student: a fault of the grader's is the instructor's to read."""
    return graded.error if graded.status == "rejected" else feedback.headline(graded)


def _json_text(fields: dict[str, Any]) -> str:
    return json.dumps(fields, indent=1, ensure_ascii=True) + "\n"
