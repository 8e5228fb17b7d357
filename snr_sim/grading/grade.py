"""Grading of one submission: every check on every case, each case in a process of its own; then the points."""

from __future__ import annotations

import logging
import shutil
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from snr_sim import __version__
from snr_sim.core.blame import describe_error, without_addresses
from snr_sim.grading.lab.lab import Case, Check, Lab
from snr_sim.grading.lab.student import Student
from snr_sim.grading.lab.verdicts import LabFault, Misbehaved, Unjudged, Verdict
from snr_sim.grading.remote.isolation import find_isolation
from snr_sim.grading.remote.launch import lent
from snr_sim.grading.remote.nursery import Nursery
from snr_sim.grading.reports.results import CaseResult, CheckResult, Demanded, Graded, Isolation, Status
from snr_sim.grading.sandbox.sandbox import Limits

OnCase = Callable[[str, str], None]
_MOST_STEPS = 10


def grade_submission(
    lab: Lab,
    folder: Path,
    secret: bytes | None = None,
    isolation: Demanded = "required",
    *,
    name: str = "",
    out: Path | None = None,
    limits: Limits | None = None,
    on_case: OnCase | None = None,
    nursery: Nursery | None = None,
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
        limits: of each of the student's processes.
        on_case: called before each case with the check's title and the case's label.
        nursery: fork server for several submissions with this isolation and limits; a new one if not given.

    Raises:
        IsolationMissing: isolation is required, and cannot be had here.
    """
    sort = sandboxed(isolation)
    status: Status = "graded"
    error = ""
    checks: tuple[CheckResult, ...] = ()
    with ExitStack() as stack:
        stack.enter_context(_unwarned())
        readable = stack.enter_context(lent(folder.resolve(), sort))
        kept = nursery or stack.enter_context(Nursery(sort, limits or Limits()))
        stack.enter_context(kept.holding(readable))
        try:
            checks = _Grading(lab, readable, secret, sort, out, limits, on_case, kept).checks()
        except LabFault as fault:
            status, error = "fault", str(fault)
    return Graded(
        submission=name or folder.resolve().name,
        lab=lab.name,
        title=lab.title,
        checks=checks,
        isolation=sort,
        is_hidden_included=secret is not None,
        kit=__version__,
        status=status,
        error=error,
        leaderboard=lab.leaderboard,
    )


def sandboxed(isolation: Demanded) -> Isolation:
    """Return the isolation of a student's process, as in reports.

    Raises:
        IsolationMissing: isolation is required, and cannot be had here.
    """
    if isolation == "none":
        return "none"
    return find_isolation()


@contextmanager
def _unwarned() -> Iterator[None]:
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
    """One submission during its checks, with the arguments of `grade_submission`."""

    lab: Lab
    folder: Path
    secret: bytes | None
    isolation: Isolation
    out: Path | None
    limits: Limits | None
    on_case: OnCase | None
    nursery: Nursery

    def checks(self) -> tuple[CheckResult, ...]:
        """Return the result of each check, in order; in practice without those that have hidden cases only."""
        done: dict[str, CheckResult] = {}
        for check in self.lab.checks:
            cases = check.cases(self.lab.name, self.secret)
            if not cases and self.secret is None:
                continue  # it has hidden cases only
            missing = [need for need in check.needs if need in done and not done[need].is_passed]
            done[check.name] = self._skipped(check, done[missing[0]]) if missing else self._tried(check, cases)
        return tuple(done.values())

    def _skipped(self, check: Check, need: CheckResult) -> CheckResult:
        return CheckResult(
            name=check.name,
            title=check.title,
            points=0.0,
            of=check.points,
            skipped_because=f"'{need.title.rstrip('.')}' comes first, and did not get all its points.",
        )

    def _tried(self, check: Check, cases: Sequence[Case]) -> CheckResult:
        results = [self._case(check, case, number) for number, case in enumerate(cases)]
        fraction = sum(one.fraction for one in results) / len(results)
        if check.all_or_nothing and fraction < 1.0:
            fraction = 0.0
        points = round(check.points * fraction, 6)
        return CheckResult(name=check.name, title=check.title, points=points, of=check.points, cases=tuple(results))

    def _case(self, check: Check, case: Case, number: int) -> CaseResult:
        if self.on_case is not None:
            self.on_case(check.title, case.label if case.is_visible else "hidden")
        run = None if self.out is None or not case.is_visible else self.out / f"{check.name}-{number + 1}"
        if run is not None:
            shutil.rmtree(run, ignore_errors=True)
        lab = self.lab
        student = Student(self.folder, self.isolation, lab.may_import, self.limits, run, self.nursery, lab.refused)
        error = given_up = ""
        try:
            with student:
                verdict = check.judge(student, case)
        except Misbehaved as wrong:
            error = wrong.message
            verdict = Verdict(0.0, wrong.hint, wrong.expected, wrong.actual)
        except Exception as fault:
            if isinstance(fault, LabFault) and not isinstance(fault, Unjudged):
                raise
            what = describe_error(fault, f"while the check '{check.name}' was tried on the case '{case.label}'")
            if not student.met or isinstance(fault, (OSError, MemoryError)):
                raise LabFault(what) from fault
            # From here on the program's result may be the cause, and a nonsensical result must not avoid a grade.
            verdict, given_up = Verdict(0.0, could_not_be_judged(student.met)), f"{what}\n{steps_to(fault)}"
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
            run_folder=self._kept(student, run, verdict),
        )

    def _kept(self, student: Student, run: Path | None, verdict: Verdict) -> str:
        """Return the recorded run of a case, if it failed; runs of passed cases are not stored."""
        if run is None or student.run_folder is None:
            return ""
        if verdict.fraction >= 1.0:
            shutil.rmtree(run, ignore_errors=True)
            return ""
        assert self.out is not None
        return student.run_folder.relative_to(self.out).as_posix()


def could_not_be_judged(file: str) -> str:
    """Return the hint where a check gave up; it contains nothing of the program's, and nothing of the case."""
    return (
        f"What {file} gave could not be judged. Has each page, and each answer, the form that the README asks for: all "
        "its fields by their names, and numbers where numbers belong?"
    )


def steps_to(fault: BaseException) -> str:
    """Return the grader's calls to where an error was raised, a line for each; the same on every computer."""
    frames = traceback.extract_tb(fault.__traceback__)[-_MOST_STEPS:]
    return "\n".join(f"  {Path(one.filename).name}, line {one.lineno}, in {one.name}: {one.line}" for one in frames)
