"""Reports on a submission: a page for the student, and files for Gradescope, for JUnit's and for check50's readers.

In Gradescope's file there is one test per check, all visible, without details of hidden cases. No test's visibility is
"hidden": Gradescope then hides the total, too. What must not be seen is not in the file.

A student's program may print anything: what Markdown would interpret is escaped, after `prelude/text.py`.

Source: "Autograder Specifications", gradescope-autograders.readthedocs.io.
"""

from __future__ import annotations

import json
import re
from typing import Any
from xml.etree import ElementTree

from snr_sim.grading.reports import feedback
from snr_sim.grading.reports.results import CaseResult, CheckResult, Graded
from snr_sim.prelude.text import one_line, plain

FAULT = "The failure is recorded for your teacher. It costs you no points."
_MAX_OUTPUT_CHARS = 20_000
_MARKDOWN = re.compile(r"([\\`*_\[\]<>|#~&!@])")
_SIGNS = {"passed": "yes", "partly": "in part", "failed": "no", "skipped": "not tried"}


def reports_of(graded: Graded) -> dict[str, str]:
    """Return the files of a student's folder."""
    return {
        "report.md": student_page(graded),
        "results.json": gradescope_results(graded),
        "junit.xml": junit(graded),
        "check50.json": check50(graded),
    }


def student_page(graded: Graded) -> str:
    """Return one page of Markdown: the points, the result of each check, and what to try."""
    lines = [f"# {markdown(graded.title)}: {markdown(graded.submission)}", "", f"**{feedback.headline(graded)}**", ""]
    if graded.status == "grader_error":
        lines += [FAULT, ""]
    elif graded.error:
        lines += [fenced(graded.error), ""]
    if graded.isolation == "none":
        lines += ["Your program was not kept apart from the grader: this is practice, not an official mark.", ""]
    if graded.notes:
        lines += ["About your files:", "", fenced("\n".join(graded.notes)), ""]
    if graded.checks:
        lines += ["| check | points | passed |", "|---|---:|---|"]
        lines += [
            f"| {markdown(check.title)} | {feedback.number(check.points)} of {feedback.number(check.max_points)} "
            f"| {_SIGNS[feedback.verdict(check)]} |"
            for check in graded.checks
        ]
    for check in graded.checks:
        lines += ["", *_section(check)]
    return "\n".join([*lines, "", f"snr_sim {markdown(graded.version)}, lab {markdown(graded.lab)}.", ""])


def _section(check: CheckResult) -> list[str]:
    lines = [f"## {markdown(check.title)} {feedback.number(check.points)} of {feedback.number(check.max_points)}", ""]
    if check.skipped_because:
        return [*lines, f"Not tried: {markdown(check.skipped_because)}"]
    for case in feedback.visible(check):
        lines += _case(case)
    return [*lines, *(f"- {markdown(line)}" for line in feedback.hidden_lines(check))]


def _case(case: CaseResult) -> list[str]:
    name = markdown(case.label) or "The case"
    if case.is_passed:
        lines = [f"- {name}: passed. {markdown(case.hint)}".rstrip()]
    else:
        percent = f"{100 * case.fraction:.0f} % right" if case.fraction > 0 else "not passed"
        lines = [f"- **{name}: {percent}.** {markdown(case.hint)}".rstrip()]
        for heading, text in feedback.parts(case):
            lines += ["", f"  {heading}:", "", fenced(text, indent="  "), ""]
    if case.run_folder:
        run = case.run_folder
        replay = f"`snr replay {run} --with FILE`, FILE being yours that flies"
        lines += ["", f"  To see this run: `snr view {run}`; to run your code on it again: {replay}.", ""]
    return lines


def markdown(text: str) -> str:
    """Return a line that Markdown shows unchanged: no links, no pictures, no HTML.

    >>> print(markdown("![x](http://a) <b>|`"))
    \\!\\[x\\](http:&#47;/a) \\<b\\>\\|\\`
    """
    # Some renderers make links of bare addresses.
    return _MARKDOWN.sub(r"\\\1", one_line(text, 2000)).replace("://", ":&#47;/").replace("www.", "www&#46;")


def fenced(text: str, indent: str = "") -> str:
    """Return a block of Markdown that shows a text unchanged, whatever it contains."""
    shown = plain(text)
    longest = max((len(run) for run in re.findall("`+", shown)), default=0)
    fence = "`" * max(3, longest + 1)
    return "\n".join(indent + line for line in [f"{fence}text", *shown.split("\n"), fence])


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
        "extra_data": {name: getattr(graded, name) for name in ("status", "isolation", "version", "lab")},
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
            message = f"{score}. {feedback.main_hint(check)}"
            failure = ElementTree.SubElement(case, "failure", message=message, type=outcome)
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
