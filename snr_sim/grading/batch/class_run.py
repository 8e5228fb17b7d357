"""A class is graded: submissions are taken in, handed to whoever grades, and kept one by one as they come back.

    take in -> workers (processes here, or a cluster) -> reports -> results/<name>.json

Only this process writes results. Whatever becomes of one submission, or of the worker that has it, is a result of that
submission, and the others go on.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence

import msgspec

from snr_sim.grading.batch.class_folder import ClassFolder
from snr_sim.grading.batch.intake import TakenIn, remove, take_in
from snr_sim.grading.batch.member_names import Refused
from snr_sim.grading.batch.submissions import Submission
from snr_sim.grading.batch.worker import Job, without_marks
from snr_sim.grading.lab.lab import Lab
from snr_sim.grading.reports.check50 import check50
from snr_sim.grading.reports.gradescope import gradescope_results
from snr_sim.grading.reports.junit import junit
from snr_sim.grading.reports.results import Demanded, Graded, with_runs_named
from snr_sim.grading.reports.student_page import student_page

RUNS = "runs"
OnDone = Callable[[Graded, bool], None]


class ClassRun:
    """Submissions on their way: what is to be done next, and where what is done goes. Any thread may ask.

    Args:
        lab: what they are tried by.
        folder: of the class, begun.
        submissions: all of them, in order.
        secret: from which hidden cases are drawn.
        isolation: "required" or "none".
        on_done: told of each result, and whether it was there already.
    """

    def __init__(
        self,
        lab: Lab,
        folder: ClassFolder,
        submissions: Sequence[Submission],
        secret: bytes,
        isolation: Demanded,
        on_done: OnDone,
    ) -> None:
        assert lab.folder is not None
        self._lab = lab
        self._checks = str(lab.folder / "checks.py")
        self._folder = folder
        self._secret = secret
        self._isolation = isolation
        self._on_done = on_done
        self._waiting: Iterator[Submission] = iter(submissions)
        self._taken: dict[str, TakenIn] = {}
        self._next = threading.Lock()
        self._telling = threading.Lock()

    def next_job(self) -> Job | None:
        """Returns the next submission that somebody has to grade, or None if there is none left.

        Those that are done, and those of which nothing can be graded, are dealt with on the way.
        """
        while True:
            with self._next:
                submission = next(self._waiting, None)
            if submission is None:
                return None
            job = self._begun(submission)
            if job is not None:
                return job

    def stop(self) -> None:
        """Hand out no further submission."""
        with self._next:
            self._waiting = iter(())

    def _begun(self, submission: Submission) -> Job | None:
        name = submission.id
        private = self._folder.place / name
        job = Job(name, self._checks, str(private), self._secret, self._isolation, "")
        try:
            taken = take_in(submission.given, self._lab.files, private)
        except Refused as refused:
            self._keep(without_marks(job, "refused", str(refused), self._lab.title), "")
            return None
        except OSError as error:  # the disk is full, or it is not ours to read
            self._keep(without_marks(job, "fault", f"It could not be read: {error}.", self._lab.title), "")
            return None
        done = self._folder.done(name, taken.digest)
        if done is not None and done.status != "fault":
            remove(private)
            self._tell(done, was_there=True)
            return None
        self._taken[name] = taken
        return msgspec.structs.replace(job, runs=str(self._folder.stage(name) / RUNS))

    def keep(self, graded: Graded) -> None:
        """Keeps what somebody made of a job, with its reports."""
        taken = self._taken.pop(graded.submission)
        named = with_runs_named(graded, lambda run: f"{RUNS}/{run}")  # as they stand in the student's folder
        self._keep(msgspec.structs.replace(named, notes=taken.notes), taken.digest)
        remove(taken.folder)

    def _keep(self, graded: Graded, digest: str) -> None:
        self._folder.keep(graded, digest, reports_of(graded))
        self._tell(graded, was_there=False)

    def _tell(self, graded: Graded, was_there: bool) -> None:
        with self._telling:
            self._on_done(graded, was_there)


def reports_of(graded: Graded) -> dict[str, str]:
    """Returns the files of a student's folder."""
    return {
        "report.md": student_page(graded),
        "results.json": gradescope_results(graded),
        "junit.xml": junit(graded),
        "check50.json": check50(graded),
    }
