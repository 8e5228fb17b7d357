"""`snr grade LAB SUBMISSION...`: grades the submissions of a class into a folder of results."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from snr_sim.cli.arguments import AsJson
from snr_sim.cli.output import print_json, print_text
from snr_sim.cli.plain_console import plain_console
from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.text import plain

if TYPE_CHECKING:
    from snr_sim.grading.batch.class_folder import ClassFolder
    from snr_sim.grading.batch.cluster import ClusterWorkers
    from snr_sim.grading.batch.stop_signals import StopSignals
    from snr_sim.grading.lab.lab import Lab
    from snr_sim.grading.reports.class_reports import Summary
    from snr_sim.grading.reports.results import Graded, RequestedIsolation

_MAX_SHOWN = 10


def grade(
    lab: Annotated[str, typer.Argument(help="A lab's name, or its folder; `snr list assignments`.")],
    submission: Annotated[list[Path] | None, typer.Argument(help="Folders and .zip files, one per student.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for results and reports.")] = None,
    secret: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Hidden cases are drawn from it; made if not given.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="How many at a time; as many as there are cores if 0.")] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Continue in the folder of an earlier run.")] = False,
    isolation: Annotated[str, typer.Option(help="'required', or 'none': not a valid grade.")] = "required",
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
    if importlib.util.find_spec("fcntl") is None:
        raise SnrError(
            "snr grade does not run on Windows: sandboxed grading requires Linux.",
            fix=f"grade on Linux, in WSL or a container; `snr check {lab} FOLDER` tries the visible cases here.",
        )
    from snr_sim.grading.batch.cluster import connected
    from snr_sim.grading.batch.stop_signals import StopSignals
    from snr_sim.grading.lab.lab import find_lab

    if isolation not in ("required", "none"):
        what = f"--isolation must be 'required' or 'none', not '{isolation}'."
        raise SnrError(what, fix="leave it out, or --isolation none.")
    requested: RequestedIsolation = "none" if isolation == "none" else "required"
    if jobs < 0:
        fix = "give a number of submissions at a time, or 0 for all cores."
        raise SnrError(f"--jobs must be at least 0, not {jobs}.", fix=fix)
    found = find_lab(lab)
    if gradescope is not None:
        raise typer.Exit(_write_container(found, submission, gradescope, secret, requested, as_json))
    if not submission:
        raise SnrError("There is nothing to grade.", fix=f"snr grade {lab} submissions/* --out results")
    if out is None:
        raise SnrError("--out is missing: the folder for the results.", fix=f"snr grade {lab} ... --out results")
    for one in submission:
        if out.resolve().is_relative_to(one.resolve()):  # the secret would be in a folder that the student can read
            fix = "name a folder elsewhere, or leave that out."
            raise SnrError(f"--out {out} is in the submission {one}.", fix=fix)
    with connected(scheduler) if scheduler else nullcontext() as cluster, StopSignals() as signals:
        status = _grade_class(found, submission, out, secret, jobs, resume, requested, cluster, signals, as_json)
    raise typer.Exit(status)


def _grade_class(
    lab: Lab,
    given: list[Path],
    out: Path,
    secret_file: Path | None,
    jobs: int,
    is_resumed: bool,
    isolation: RequestedIsolation,
    cluster: ClusterWorkers | None,
    signals: StopSignals,
    as_json: bool,
) -> int:
    from snr_sim import __version__
    from snr_sim.grading.batch.class_folder import ClassFolder, ClassSettings, digest_of_secret
    from snr_sim.grading.batch.class_run import ClassRun, write_class_files
    from snr_sim.grading.batch.submission_import import digest_of_folder
    from snr_sim.grading.batch.submissions import name_submissions
    from snr_sim.grading.batch.workers import LocalWorkers
    from snr_sim.grading.grade import resolve_isolation

    if cluster is None:
        resolve_isolation(isolation)  # raises before anything is written
    name_submissions(given, required_files=lab.files)
    assert lab.folder is not None
    folder = ClassFolder(out, is_resumed)
    try:
        submissions = name_submissions(given, folder.known, lab.files)
        secret, is_made = folder.secret(secret_file)
        digests = digest_of_folder(lab.folder), digest_of_secret(secret)
        folder.begin(ClassSettings(lab.name, digests[0], __version__, digests[1], isolation), submissions)
        if is_made:
            made = folder.path / "secret"
            _print_note(f"Hidden cases are drawn from {made}, made just now: keep it, and keep it secret.")
        if isolation == "none":
            _print_note("Programs are not isolated from the grader (--isolation none): these are not valid grades.")
        with _progress(len(submissions)) as on_graded, ExitStack() as stack:
            cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
            workers = cluster or stack.enter_context(LocalWorkers(min(jobs or cores, len(submissions))))
            ClassRun(lab, folder, submissions, secret, isolation, on_graded).grade(workers, signals.interruptible)
        with signals.interruptible():
            summary, no_picture = write_class_files(folder, lab.title)
        if no_picture:
            _print_note(no_picture)
        _print_summary(folder, summary, as_json)
        return 1 if summary.grader_errors else 0
    except KeyboardInterrupt:
        _print_note(f"What is done is kept in {folder.path}: continue with --resume.")
        raise
    finally:
        folder.close()


def _write_container(
    lab: Lab,
    submissions: list[Path] | None,
    out: Path,
    secret_file: Path | None,
    isolation: RequestedIsolation,
    as_json: bool,
) -> int:
    from snr_sim.grading.batch.class_folder import new_secret, read_secret
    from snr_sim.grading.batch.gradescope import write_container

    if submissions:
        raise SnrError("--gradescope takes no submissions: Gradescope collects them.", fix="leave them out.")
    write_container(lab, read_secret(secret_file) if secret_file else new_secret(), isolation, out)
    if as_json:
        print_json({"out": str(out)})
    else:
        how = f"(cd {out} && zip -r ../autograder.zip .)"
        print_text(f"{out} is an autograder for Gradescope. Zip what is in it: {how}")
    return 0


def _print_note(words: str) -> None:
    print_line(sys.stderr, words)


@contextmanager
def _progress(total: int) -> Iterator[Callable[[Graded], None]]:
    """Yield a function that reports each result: with a progress bar on a terminal, not at all in a pipe."""
    if not sys.stderr.isatty():
        yield lambda graded: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("graded"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}", style="dim", markup=False),
    )
    with Progress(*columns, console=plain_console(stderr=True)) as bar:
        task = bar.add_task("", total=total)

        def on_graded(graded: Graded) -> None:
            bar.update(task, advance=1, description=graded.submission)

        yield on_graded


def _print_summary(folder: ClassFolder, summary: Summary, as_json: bool) -> None:
    if as_json:
        graded = folder.every_result()
        print_json({
            "out": str(folder.path),
            "words": summary.sentence(),
            "max_points": summary.max_points,
            "rejected": summary.rejected,
            "grader_errors": summary.grader_errors,
            "unjudged": summary.unjudged,
            "submissions": [
                {"submission": one.submission, "status": one.status, "points": one.points, "error": plain(one.error)}
                for one in graded
            ],
        })  # fmt: skip
        return
    print_text(summary.sentence())
    for names, words in (
        (summary.rejected, "could not be read, which is 0 points"),
        (summary.grader_errors, "have no mark, as the lab or the grader failed; why is in class.csv"),
        (summary.unjudged, "gave in some case what its check could not judge, which is 0 for it; why is in class.csv"),
    ):
        if names:
            more = f" and {len(names) - _MAX_SHOWN} more" if len(names) > _MAX_SHOWN else ""
            print_text(f"{len(names)} {words}: {', '.join(names[:_MAX_SHOWN])}{more}.")
    print_text(f"tables: {folder.path}/class.csv, cases.csv; a page each: {folder.path}/students/*/report.md")
