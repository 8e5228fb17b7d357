"""`snr check LAB [FOLDER]`: runs the visible part of a lab on a folder and prints the next step."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from snr_sim.cli.arguments import AsJson
from snr_sim.cli.output import print_encoded, print_note
from snr_sim.cli.plain_console import escape_markup, plain_console
from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import Lab, find_lab
from snr_sim.grading.lab.verdicts import GraderError
from snr_sim.grading.reports.results import CaseResult, CheckResult, Graded, encode_graded
from snr_sim.prelude.errors import UnknownNameError
from snr_sim.scenario.source_checks import notes_on_files


def check(
    lab: Annotated[str, typer.Argument(help="A lab's name: depth_hold; `snr list assignments`.")],
    folder: Annotated[Path, typer.Argument(help="With your files; the current folder if not given.")] = Path(),
    as_json: AsJson = False,
) -> None:
    """Try the visible checks of a lab on your files.

    This is practice: the grader has further cases.

    Exit status: 0 all points, 1 not all, 2 the request was wrong.
    """
    found = find_lab(lab)
    if not folder.is_dir():
        what = f"{folder} is a file, not a folder." if folder.is_file() else f"There is no folder {folder}."
        raise UnknownNameError(what, fix="name the folder with your files.")
    missing = [file for file in found.files if not (folder / file).is_file()]
    if missing:
        begin = f"begin: snr new lab {lab}"
        if len(missing) < len(found.files):  # the folder is one of this lab, so `snr new lab` would refuse it
            begin = f"copy it again: {found.folder}/starter/{missing[0]}"
        raise UnknownNameError(
            f"There is no {missing[0]} in {folder.resolve()}.", fix=f"name the folder with your files; or {begin}"
        )
    for note in notes_on_files([folder / file for file in found.files if file.endswith(".py")]):
        print_note(note)
    out = Path("runs") / f"check_{found.name}"
    with _status(as_json) as on_case:
        graded = grade_submission(found, folder, None, "none", out=out.resolve(), on_case=on_case)
    if graded.status == "grader_error":
        raise GraderError(graded.error)
    if as_json:
        print_encoded(encode_graded(graded).decode(), end="")
    else:
        _show(found, graded, out)
    sys.exit(0 if all(one.is_passed for one in graded.checks) else 1)


@contextmanager
def _status(is_json: bool) -> Iterator[Callable[[str, str], None]]:
    """Yield a function that shows the status of each case on a terminal."""
    if is_json or not sys.stderr.isatty():
        yield lambda check, case: None
        return
    with plain_console(stderr=True).status("starting") as status:
        yield lambda check, case: status.update(escape_markup(f"{check}: {case}" if case else check))


def _show(lab: Lab, graded: Graded, out: Path) -> None:
    """Print a table of the checks, the failures, and the next step."""
    from rich import box
    from rich.table import Table

    console = plain_console()
    table = Table(box=box.SIMPLE, title=f"{lab.title}: practice, visible cases only", title_justify="left")
    table.add_column("")
    table.add_column("check")
    table.add_column("points", justify="right")
    for check in graded.checks:
        mark = "-" if check.skipped_because else ("ok" if check.is_passed else "x")
        table.add_row(mark, check.title, f"{round(check.points, 2):g} of {check.max_points:g}")
    points, max_points = graded.points or 0.0, sum(check.max_points for check in graded.checks)
    table.add_row("", "together", f"{round(points, 2):g} of {max_points:g}", end_section=True)
    console.print(table)
    for check in graded.checks:
        for line in _lines(check, out):
            console.print(line, soft_wrap=True)
    for reason in dict.fromkeys(check.skipped_because for check in graded.checks if check.skipped_because):
        skipped = (f"    {check.title}\n" for check in graded.checks if check.skipped_because == reason)
        console.print(f"- not tried: {reason}\n" + "".join(skipped), soft_wrap=True)
    console.print(_next(graded), soft_wrap=True)


def _lines(check: CheckResult, out: Path) -> Iterator[str]:
    """Yield the lines about a check that did not get all its points."""
    failures: dict[str, list[CaseResult]] = {}  # equal failures are printed once
    for case in check.cases:
        if not case.is_passed:
            failures.setdefault("".join(f"    {line}\n" for line in _of_case(case)), []).append(case)
    for words, cases in failures.items():
        about = "; ".join(case.label for case in cases if case.label)
        folders = [out / case.run_folder for case in cases if case.run_folder]
        runs = "".join(
            f"    look at the run: snr view {run}    run your code on it again: snr replay {run}\n" for run in folders
        )
        yield f"x {check.title}{f' ({about})' if about else ''}\n{words}{runs}"


def _of_case(case: CaseResult) -> Iterator[str]:
    yield from case.error.splitlines()
    for heading, text in (("hint:", case.hint), ("expected:", case.expected), ("actual:  ", case.actual)):
        if text:
            yield f"{heading} {text}"
    if case.printed:
        yield "what your program printed:"
        yield from (f"  {line}" for line in case.printed.splitlines()[-10:])


def _next(graded: Graded) -> str:
    if all(check.is_passed for check in graded.checks):
        return (
            "All visible cases are right. The grader tries others, too: think of what they could be, then hand it in."
        )
    first = next(check for check in graded.checks if not check.is_passed)
    return f"Next: '{first.title}'. Change your file, save it, and run snr check again."
