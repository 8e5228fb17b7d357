"""Grading of one submission: every check on every case, each case in a process of its own; then the points."""

from __future__ import annotations

import logging
import shutil
import traceback
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeAlias

from msgspec.structs import replace

from snr_sim import __version__
from snr_sim.core.source_location import describe_error, without_addresses
from snr_sim.grading.lab.lab import Case, Check, Lab
from snr_sim.grading.lab.student import Student
from snr_sim.grading.lab.verdicts import CheckVerdict, GraderError, InconclusiveError, SubmissionError
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.remote.isolation import find_isolation
from snr_sim.grading.remote.launch import readable_copy
from snr_sim.grading.reports.results import CaseResult, CheckResult, Graded, Isolation, RequestedIsolation, Status
from snr_sim.grading.sandbox.sandbox import Limits

OnCase: TypeAlias = Callable[[str, str], None]
_MAX_STEPS = 10


def grade_submission(
    lab: Lab,
    folder: Path,
    secret: bytes | None = None,
    isolation: RequestedIsolation = "required",
    *,
    name: str = "",
    out: Path | None = None,
    on_case: OnCase | None = None,
    fork_server: ForkServer | None = None,
) -> Graded:
    """Return the result of a submission. The same submission, lab and secret give the same result.

    Args:
        lab: its checks and cases.
        folder: of the submission; nothing is written there.
        secret: from which hidden cases are drawn; without it only visible ones are tried, and checks without any are
            left out.
        isolation: "required" refuses to run without isolation; "none" is for practice.
        name: of the submission in reports; the folder's name if not given.
        out: folder for recorded runs of visible cases that failed, each a folder; not stored if not given.
        on_case: called before each case with the check's title and the case's label.
        fork_server: fork server for several submissions with this isolation; a new one if not given.

    Raises:
        IsolationMissingError: isolation is required, and cannot be had here.
    """
    mode = resolve_isolation(isolation)
    status: Status = "graded"
    error = ""
    checks: tuple[CheckResult, ...] = ()
    with ExitStack() as stack:
        stack.enter_context(_silence_warnings())
        readable = stack.enter_context(readable_copy(folder.resolve(), mode))
        server = fork_server or stack.enter_context(ForkServer(mode, Limits()))
        stack.enter_context(server.with_submission(readable))
        new_student = partial(Student, readable, mode, lab.may_import, fork_server=server, refused=lab.refused)
        try:
            checks = _Grading(lab, secret, new_student, out, on_case).checks()
        except GraderError as fault:
            status, error = "grader_error", str(fault)
    return Graded(
        submission=name or folder.resolve().name,
        lab=lab.name,
        title=lab.title,
        checks=checks,
        isolation=mode,
        includes_hidden=secret is not None,
        version=__version__,
        status=status,
        error=error,
        leaderboard=lab.leaderboard,
    )


def resolve_isolation(isolation: RequestedIsolation) -> Isolation:
    """Return the isolation of a student's process, as in reports; raise IsolationMissingError if there is none."""
    return "none" if isolation == "none" else find_isolation()


@contextmanager
def _silence_warnings() -> Iterator[None]:
    """Suppress warnings of components: a dropped link may be the subject of a run, and no user watches it here."""
    logger = logging.getLogger("snr")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


@dataclass(frozen=True)
class _Grading:
    """One submission during its checks, with arguments of `grade_submission`."""

    lab: Lab
    secret: bytes | None
    new_student: Callable[..., Student]
    out: Path | None
    on_case: OnCase | None

    def checks(self) -> tuple[CheckResult, ...]:
        """Return the result of each check, in order; in practice without those that have hidden cases only."""
        done: dict[str, CheckResult] = {}
        for check in self.lab.checks:
            cases = check.cases(self.lab.name, self.secret)
            if not cases and self.secret is None:
                continue  # it has hidden cases only
            result = CheckResult(name=check.name, title=check.title, points=0.0, max_points=check.points)
            missing = [done[need] for need in check.needs if need in done and not done[need].is_passed]
            if missing:
                reason = f"'{missing[0].title.rstrip('.')}' comes first, and did not get all its points."
                done[check.name] = replace(result, skipped_because=reason)
                continue
            results = tuple(self._case(check, case, number) for number, case in enumerate(cases))
            fraction = sum(one.fraction for one in results) / len(results)
            if check.all_or_nothing and fraction < 1.0:
                fraction = 0.0
            done[check.name] = replace(result, points=round(check.points * fraction, 6), cases=results)
        return tuple(done.values())

    def _case(self, check: Check, case: Case, number: int) -> CaseResult:
        if self.on_case is not None:
            self.on_case(check.title, case.label if case.is_visible else "hidden")
        run = None if self.out is None or not case.is_visible else self.out / f"{check.name}-{number + 1}"
        if run is not None:
            shutil.rmtree(run, ignore_errors=True)
        student = self.new_student(record_to=run)
        error = given_up = ""
        try:
            with student:
                verdict = check.evaluate(student, case)
        except SubmissionError as wrong:
            error = wrong.message
            verdict = CheckVerdict(0.0, wrong.hint, wrong.expected, wrong.actual)
        except Exception as fault:
            if isinstance(fault, GraderError) and not isinstance(fault, InconclusiveError):
                raise
            what = describe_error(fault, f"while the check '{check.name}' was tried on the case '{case.label}'")
            if not student.last_file or isinstance(fault, (OSError, MemoryError)):
                raise GraderError(what) from fault
            # From here on the program's result may be the cause, and a nonsensical result must not avoid a grade.
            verdict = CheckVerdict(0.0, inconclusive_hint(student.last_file))
            given_up = f"{what}\n{format_steps(fault)}"
            error = f"It stopped the check: {without_addresses(f'{type(fault).__name__}: {fault}')}"
        return CaseResult(
            label=case.label,
            is_visible=case.is_visible,
            fraction=float(verdict.fraction),
            hint=verdict.hint,
            expected=verdict.expected,
            actual=verdict.actual,
            error=error,
            printed=student.printed,
            metrics={name: float(value) for name, value in verdict.metrics.items()},
            fault=given_up,
            run_folder=self._keep_failed_run(student, run, verdict),
        )

    def _keep_failed_run(self, student: Student, run: Path | None, verdict: CheckVerdict) -> str:
        """Return the recorded run of a case, if it failed; runs of passed cases are not stored."""
        if run is None or student.run_folder is None:
            return ""
        if verdict.fraction >= 1.0:
            shutil.rmtree(run, ignore_errors=True)
            return ""
        assert self.out is not None
        return student.run_folder.relative_to(self.out).as_posix()


def inconclusive_hint(file: str) -> str:
    """Return the hint where a check gave up; it contains nothing of the program's, and nothing of the case."""
    return (
        f"What {file} gave could not be judged. Has each page, and each answer, the form that the README asks for: all "
        "its fields by their names, and numbers where numbers belong?"
    )


def format_steps(fault: BaseException) -> str:
    """Return the grader's calls to where an error was raised, a line for each; the same on every computer."""
    frames = traceback.extract_tb(fault.__traceback__)[-_MAX_STEPS:]
    return "\n".join(f"  {Path(one.filename).name}, line {one.lineno}, in {one.name}: {one.line}" for one in frames)
