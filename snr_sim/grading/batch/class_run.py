"""Grading of a class: submissions are imported, given to workers, and their results stored one by one.

    import -> workers (processes here, or a cluster) -> reports -> results/<name>.json -> tables of the class

Only this process writes results, and only its main thread. Whatever happens to one submission, or to its worker,
is a result of that submission, and the others continue.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import msgspec

from snr_sim.grading.batch.class_folder import ClassFolder
from snr_sim.grading.batch.cluster import ClusterWorkers
from snr_sim.grading.batch.member_names import SubmissionRejectedError
from snr_sim.grading.batch.submission_import import ImportedSubmission, import_submission, remove
from snr_sim.grading.batch.submissions import Submission
from snr_sim.grading.batch.worker import Job, ungraded_result
from snr_sim.grading.batch.workers import LocalWorkers
from snr_sim.grading.lab.lab import Lab
from snr_sim.grading.reports import class_reports
from snr_sim.grading.reports.results import Graded, RequestedIsolation, with_runs_named
from snr_sim.grading.reports.student_reports import reports_of
from snr_sim.prelude.errors import MissingExtraError
from snr_sim.recording.atomic_files import write_atomic

RUNS = "runs"
# A signal just before a wait does not end it: so no wait is longer.
_MAX_WAIT_S = 1.0


class ClassRun:
    """Submissions in progress, into the folder of a class that was begun.

    `on_done` is called with each result, also with those that are there already.
    """

    def __init__(
        self,
        lab: Lab,
        folder: ClassFolder,
        submissions: Sequence[Submission],
        secret: bytes,
        isolation: RequestedIsolation,
        on_done: Callable[[Graded], None],
    ) -> None:
        assert lab.folder is not None
        self._lab = lab
        self._checks = str(lab.folder / "checks.py")
        self._folder = folder
        self._secret = secret
        self._isolation = isolation
        self._on_done = on_done
        self._waiting = iter(submissions)

    def grade(
        self,
        workers: LocalWorkers | ClusterWorkers,
        interruptible: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        """Grade all submissions; raise OSError if a result cannot be written, such as on a full disk.

        Args:
            workers: grade them; the caller closes them.
            interruptible: is entered while this only waits, and may raise there: `StopSignals.interruptible`.
        """
        in_progress: dict[Future[Any], tuple[Job, ImportedSubmission]] = {}
        while True:
            ahead = workers.ahead
            while len(in_progress) < ahead and (begun := self._next_begun()) is not None:
                in_progress[workers.submit(begun[0])] = begun
            if not in_progress:
                return
            with interruptible():
                done = wait(in_progress, _MAX_WAIT_S, FIRST_COMPLETED).done
            for future in done:
                job, taken = in_progress.pop(future)
                self.keep(workers.result(future, job), taken)

    def _next_begun(self) -> tuple[Job, ImportedSubmission] | None:
        """Return the next submission that has to be graded, taken in; None if there is none left.

        Those that are done, and those of which nothing can be graded, are dealt with on the way.
        """
        for name, given in self._waiting:
            private = self._folder.private_folder / name
            job = Job(name, self._checks, str(private), self._secret, self._isolation, "")
            try:
                taken = import_submission(given, self._lab.files, private)
            except SubmissionRejectedError as rejection:
                self._keep(ungraded_result(job, "rejected", str(rejection), self._lab.title), "")
                continue
            except OSError as error:  # the disk is full, or it is not readable
                self._keep(ungraded_result(job, "grader_error", f"It could not be read: {error}.", self._lab.title), "")
                continue
            done = self._folder.done(name, taken.digest)
            if done is None or done.status == "grader_error":
                return msgspec.structs.replace(job, runs=str(self._folder.stage(name) / RUNS)), taken
            remove(private)
            self._on_done(done)
        return None

    def keep(self, graded: Graded, taken: ImportedSubmission) -> None:
        """Keep the result of a submission, with its reports."""
        named = with_runs_named(graded, lambda run: f"{RUNS}/{run}")  # paths relative to the student's folder
        self._keep(msgspec.structs.replace(named, notes=taken.notes), taken.digest)
        remove(taken.folder)

    def _keep(self, graded: Graded, digest: str) -> None:
        self._folder.keep(graded, digest, reports_of(graded))
        self._on_done(graded)


def write_class_files(folder: ClassFolder, title: str) -> tuple[class_reports.Summary, str]:
    """Write class.csv, cases.csv, leaderboard.csv if something is ranked, and distribution.png.

    Return the class in numbers, and why there is no picture, if there is none.
    """
    summary = class_reports.Summary()
    for graded in folder.every_result():
        summary.add(graded)
    given = {one.id: str(one.given) for one in folder.known}
    _write(folder.path / "class.csv", lambda table: class_reports.write_class(table, folder.every_result, given))
    _write(folder.path / "cases.csv", lambda table: class_reports.write_cases(table, folder.every_result()))
    if summary.ranked:
        _write(folder.path / "leaderboard.csv", lambda table: class_reports.write_leaderboard(table, summary))
    try:
        class_reports.draw_distribution(summary, title, folder.path / "distribution.png")
    except (MissingExtraError, ImportError) as error:
        return summary, f"There is no picture of the distribution. {error}"
    return summary, ""


def _write(path: Path, fill: Callable[[io.StringIO], None]) -> None:
    table = io.StringIO(newline="")
    fill(table)
    write_atomic(path, table.getvalue().encode())
