"""JUnit's XML, which most services that run tests can show: one test case per check."""

from __future__ import annotations

from xml.etree import ElementTree

from snr_sim.grading.reports import feedback
from snr_sim.grading.reports.plain import one_line, plain
from snr_sim.grading.reports.results import Graded


def junit(graded: Graded) -> str:
    """Return the file's text. It has no times: the same submission gives the same file."""
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
        words = one_line(graded.error) if graded.status == "rejected" else feedback.headline(graded)
        ElementTree.SubElement(case, "error", message=words, type=graded.status)
    for check, outcome in zip(graded.checks, outcomes, strict=True):
        case = ElementTree.SubElement(suite, "testcase", classname=one_line(graded.lab), name=one_line(check.name))
        if outcome == "skipped":
            ElementTree.SubElement(case, "skipped", message=one_line(check.skipped_because))
        elif outcome != "passed":
            score = f"{feedback.number(check.points)} of {feedback.number(check.max_points)} points"
            failure = ElementTree.SubElement(
                case, "failure", message=f"{score}. {feedback.main_hint(check)}", type=outcome
            )
            failure.text = plain(feedback.as_text(check), 20_000)
    ElementTree.indent(suite)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(suite, encoding="unicode") + "\n"
