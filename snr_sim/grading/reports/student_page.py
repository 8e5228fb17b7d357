"""One page of Markdown for a student: the points, the result of each check, and what to try."""

from __future__ import annotations

from snr_sim.grading.reports import feedback
from snr_sim.grading.reports.plain import fenced, markdown
from snr_sim.grading.reports.results import CaseResult, CheckResult, Graded

_SIGNS = {"passed": "yes", "partly": "in part", "failed": "no", "skipped": "not tried"}
FAULT = "The failure is recorded for your teacher. It costs you no points."


def student_page(graded: Graded) -> str:
    """Return the page."""
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
