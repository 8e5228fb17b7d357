"""One page of Markdown for a student: the points, the result of each check, and what to try."""

from __future__ import annotations

from snr_sim.grading.reports import told
from snr_sim.grading.reports.plain import fenced, markdown
from snr_sim.grading.reports.results import CaseResult, CheckResult, Graded

_SIGNS = {"passed": "yes", "partly": "in part", "failed": "no", "skipped": "not tried"}
FAULT = "Your teacher was told what happened. It costs you nothing."


def student_page(graded: Graded) -> str:
    """Return the page."""
    lines = [f"# {markdown(graded.title)}: {markdown(graded.submission)}", "", f"**{told.headline(graded)}**", ""]
    if graded.status == "fault":
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
            f"| {markdown(check.title)} | {told.number(check.points)} of {told.number(check.of)} "
            f"| {_SIGNS[told.verdict(check)]} |"
            for check in graded.checks
        ]
    for check in graded.checks:
        lines += ["", *_section(check)]
    return "\n".join([*lines, "", f"snr_sim {markdown(graded.kit)}, lab {markdown(graded.lab)}.", ""])


def _section(check: CheckResult) -> list[str]:
    lines = [f"## {markdown(check.title)} {told.number(check.points)} of {told.number(check.of)}", ""]
    if check.skipped_because:
        return [*lines, f"Not tried: {markdown(check.skipped_because)}"]
    for case in told.visible(check):
        lines += _case(case)
    return [*lines, *(f"- {markdown(line)}" for line in told.hidden_lines(check))]


def _case(case: CaseResult) -> list[str]:
    name = markdown(case.label) or "The case"
    if case.is_passed:
        lines = [f"- {name}: passed. {markdown(case.hint)}".rstrip()]
    else:
        share = f"{100 * case.fraction:.0f} % right" if case.fraction > 0 else "not passed"
        lines = [f"- **{name}: {share}.** {markdown(case.hint)}".rstrip()]
        for heading, text in told.parts(case):
            lines += ["", f"  {heading}:", "", fenced(text, indent="  "), ""]
    if case.run_folder:
        run = case.run_folder
        replay = f"`snr replay {run} --with FILE`, FILE being yours that flies"
        lines += ["", f"  To see this run: `snr view {run}`; to run your code on it again: {replay}.", ""]
    return lines
