"""`snr grade LAB SUBMISSION...`: grades the submissions of a class into a folder of results."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from snr_sim.cli.arguments import AsJson
from snr_sim.cli.output import print_json

if TYPE_CHECKING:
    from snr_sim.grading.batch.class_folder import ClassFolder
    from snr_sim.grading.batch.cluster import ClusterWorkers
    from snr_sim.grading.batch.stop_signals import StopSignals
    from snr_sim.grading.batch.submissions import Submission
    from snr_sim.grading.lab.lab import Lab
    from snr_sim.grading.reports.class_table import Summary
    from snr_sim.grading.reports.results import Demanded, Graded

_MOST_SHOWN = 10


def grade(
    lab: Annotated[str, typer.Argument(help="A lab's name, or its folder; `snr list assignments`.")],
    submission: Annotated[list[Path] | None, typer.Argument(help="Folders and .zip files, one per student.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for results and reports.")] = None,
    secret: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Hidden cases are drawn from it; made if not given.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="How many at a time; as many as there are cores if 0.")] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Go on in the folder where it was.")] = False,
    isolation: Annotated[str, typer.Option(help="'required', or 'none': then it is no mark.")] = "required",
    scheduler: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Of a dask scheduler, tcp://...: its cluster grades.")
    ] = "",
    gradescope: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write a Gradescope autograder for the lab instead.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Grade submissions, with hidden cases, each program in a sandbox.

    Exit status: 0 all are graded, 1 some could not be (see class.csv), 2 the request was wrong.
    """
    _refuse_windows(lab)
    from snr_sim.grading.batch.cluster import connected
    from snr_sim.grading.batch.stop_signals import StopSignals
    from snr_sim.grading.lab.lab import find_lab
    from snr_sim.prelude.errors import SnrError

    if isolation not in ("required", "none"):
        raise SnrError(f"--isolation is '{isolation}'.", fix="'required' or 'none'.")
    demanded: Demanded = "none" if isolation == "none" else "required"
    if jobs < 0:
        raise SnrError(f"--jobs is {jobs}.", fix="a number of submissions at a time, or 0 for all cores.")
    found = find_lab(lab)
    if gradescope is not None:
        raise typer.Exit(_write_container(found, submission, gradescope, secret, demanded, as_json))
    if not submission:
        raise SnrError("There is nothing to grade.", fix=f"snr grade {lab} submissions/* --out results")
    if out is None:
        raise SnrError("Where should the results go?", fix=f"snr grade {lab} ... --out results")
    for one in submission:
        if out.resolve().is_relative_to(one.resolve()):  # the secret would be in a folder that the student can read
            raise SnrError(
                f"--out {out} is in the submission {one}.", fix="name a folder elsewhere, or leave that out."
            )
    with connected(scheduler) if scheduler else nullcontext() as cluster, StopSignals() as signals:
        status = _grade_class(found, submission, out, secret, jobs, resume, demanded, cluster, signals, as_json)
    raise typer.Exit(status)


def _refuse_windows(lab: str) -> None:
    from snr_sim.prelude.errors import SnrError

    if importlib.util.find_spec("fcntl") is None:
        raise SnrError(
            "snr grade does not run on Windows: what keeps students' programs apart is Linux's own.",
            fix=f"grade on Linux, in WSL or a container; `snr check {lab} FOLDER` tries the visible cases here.",
        )


def _grade_class(
    lab: Lab,
    given: list[Path],
    out: Path,
    secret_file: Path | None,
    jobs: int,
    is_resumed: bool,
    isolation: Demanded,
    cluster: ClusterWorkers | None,
    signals: StopSignals,
    as_json: bool,
) -> int:
    from snr_sim import __version__
    from snr_sim.grading.batch.class_files import write_class_files
    from snr_sim.grading.batch.class_folder import ClassFolder, Terms, digest_of_secret
    from snr_sim.grading.batch.class_run import ClassRun
    from snr_sim.grading.batch.intake import digest_of_folder
    from snr_sim.grading.batch.submissions import name_submissions
    from snr_sim.grading.batch.workers import LocalWorkers
    from snr_sim.grading.grade import sandboxed

    if cluster is None:
        sandboxed(isolation)  # raises before anything is written
    name_submissions(given, wanted_files=lab.files)
    assert lab.folder is not None
    folder = ClassFolder(out, is_resumed)
    try:
        submissions = name_submissions(given, folder.known, lab.files)
        secret, is_made = folder.secret(secret_file)
        terms = Terms(lab.name, digest_of_folder(lab.folder), __version__, digest_of_secret(secret), isolation)
        folder.begin(terms, submissions)
        if is_made:
            _say(
                f"Hidden cases are drawn from {folder.path / 'secret'}, made just now: keep it, and show it to nobody."
            )
        if isolation == "none":
            _say("Programs are not kept apart from the grader (--isolation none): these are no marks.")
        with _progress(len(submissions)) as told, ExitStack() as stack:
            workers = cluster or stack.enter_context(LocalWorkers(min(jobs or _cores(), len(submissions))))
            ClassRun(lab, folder, submissions, secret, isolation, told).grade(workers, signals.interruptible)
        with signals.interruptible():
            summary, no_picture = write_class_files(folder, lab.title)
        if no_picture:
            _say(no_picture)
        _tell(folder, submissions, summary, as_json)
        return 1 if summary.faults else 0
    except KeyboardInterrupt:
        _say(f"What is done is kept in {folder.path}: go on with --resume.")
        raise
    finally:
        folder.close()


def _write_container(
    lab: Lab, submissions: list[Path] | None, out: Path, secret_file: Path | None, isolation: Demanded, as_json: bool
) -> int:
    from snr_sim.grading.batch.class_folder import made_secret, read_secret
    from snr_sim.grading.batch.gradescope import write_container
    from snr_sim.prelude.errors import SnrError

    if submissions:
        raise SnrError("With --gradescope there are no submissions: Gradescope has them.", fix="leave them out.")
    write_container(lab, read_secret(secret_file) if secret_file else made_secret(), isolation, out)
    if as_json:
        print_json({"out": str(out)})
    else:
        print(f"{out} is an autograder for Gradescope. Zip what is in it: (cd {out} && zip -r ../autograder.zip .)")
    return 0


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _say(words: str) -> None:
    print(words, file=sys.stderr)


@contextmanager
def _progress(total: int) -> Iterator[Callable[[Graded, bool], None]]:
    """Yield a function that reports each result: with a progress bar on a terminal, not at all in a pipe."""
    if not sys.stderr.isatty():
        yield lambda graded, was_there: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from snr_sim.cli.plain_console import plain_console

    columns = (
        TextColumn("graded"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}", style="dim", markup=False),
    )
    with Progress(*columns, console=plain_console(stderr=True)) as bar:
        task = bar.add_task("", total=total)

        def told(graded: Graded, was_there: bool) -> None:
            bar.update(task, advance=1, description=graded.submission)

        yield told


def _tell(folder: ClassFolder, submissions: list[Submission], summary: Summary, as_json: bool) -> None:
    if as_json:
        print_json(_fields(folder, summary))
        return
    print(summary.words())
    for names, words in (
        (summary.refused, "could not be read, which is 0 points"),
        (summary.faults, "have no mark, as the lab or the grader failed; why is in class.csv"),
        (summary.unjudged, "gave in some case what its check could not judge, which is 0 for it; why is in class.csv"),
    ):
        if names:
            more = f" and {len(names) - _MOST_SHOWN} more" if len(names) > _MOST_SHOWN else ""
            print(f"{len(names)} {words}: {', '.join(names[:_MOST_SHOWN])}{more}.")
    print(f"tables: {folder.path}/class.csv, cases.csv; a page each: {folder.path}/students/*/report.md")


def _fields(folder: ClassFolder, summary: Summary) -> dict[str, Any]:
    from snr_sim.grading.reports.plain import plain

    return {
        "out": str(folder.path),
        "words": summary.words(),
        "of": summary.of,
        "refused": summary.refused,
        "faults": summary.faults,
        "unjudged": summary.unjudged,
        "submissions": [
            {"submission": one.submission, "status": one.status, "points": one.points, "error": plain(one.error)}
            for one in folder.every_result()
        ],
    }
