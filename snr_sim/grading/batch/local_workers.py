"""Grades a class on this computer: a worker process per core, each with a thread that feeds it and hears it.

A worker that dies, or does not end, costs the submission it had one more try in a fresh one; after that it is a fault,
which is told, and no mark.

A worker and the program that it grades take turns, never both at work. So where every core has its worker, each stays
on its own, with its program: what they say to each other wakes nobody elsewhere, and what they compute with is at hand.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import partial
from queue import Empty, SimpleQueue
from typing import TypeAlias

import msgspec

from snr_sim.core.process.spawn import Spawned, how_it_ended, print_line
from snr_sim.grading.batch.class_run import ClassRun
from snr_sim.grading.batch.worker import Job, ended_by_its_job, without_marks
from snr_sim.grading.reports.results import Graded, decode_graded

LIMIT_S = 3600.0  # for one submission; far beyond what the limits of all its cases together allow
_TRIES = 2
_WORKER = "snr_sim.grading.batch.worker:serve"
_LOOK_S = 1.0

Interruptible: TypeAlias = Callable[[], AbstractContextManager[None]]


def grade_here(
    run: ClassRun,
    jobs: int,
    limit_s: float = LIMIT_S,
    target: str = _WORKER,
    interruptible: Interruptible = nullcontext,
) -> None:
    """Grade all that a run has; return when every thread and worker has ended, however that comes.

    Args:
        run: gives the submissions and keeps the results.
        jobs: how many at a time.
        limit_s: how long one may take on the wall clock.
        target: what runs in a worker.
        interruptible: is entered while this only waits, and may raise there: `StopSignals.interruptible`.

    Raises:
        Exception: whatever went wrong here, such as a full disk; workers are ended before.
    """
    ended: SimpleQueue[_Feeder] = SimpleQueue()
    feeders = [_Feeder(run, target, cores, ended) for cores in _cores_of(jobs)]
    try:
        for feeder in feeders:
            feeder.start()
        _wait_for(set(feeders), ended, limit_s, interruptible)
    finally:
        run.stop()
        for feeder in feeders:
            feeder.stop()
        for feeder in feeders:
            if feeder.ident is not None:  # the system may have refused to start it
                feeder.join()


def _wait_for(running: set[_Feeder], ended: SimpleQueue[_Feeder], limit_s: float, interruptible: Interruptible) -> None:
    """Wait for all feeders.

    Raises:
        Exception: the failure of the first one that failed.
    """
    while running:
        # Not by `Thread.join` or `is_alive`: if an exception interrupts them, Python before 3.13 marks the thread as
        # ended, and no later `join` waits for it (bpo-46726). The thread then wrote to a folder that was being removed.
        with suppress(Empty), interruptible():
            feeder = ended.get(timeout=_LOOK_S)
            running.remove(feeder)
            if feeder.failure is not None:
                raise feeder.failure
        for feeder in running:
            feeder.end_if_later_than(limit_s)


def _cores_of(jobs: int) -> list[set[int]]:
    """Returns for each worker the core that it stays on; none if it may go anywhere, as cores are left over."""
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    if not cores or jobs < len(cores):
        return [set() for _ in range(jobs)]
    return [{cores[i % len(cores)]} for i in range(jobs)]


class _Feeder(threading.Thread):
    """Keeps one worker busy, and replaces it when it dies."""

    def __init__(self, run: ClassRun, target: str, cores: set[int], ended: SimpleQueue[_Feeder]) -> None:
        super().__init__(daemon=True)
        self.failure: BaseException | None = None
        self._run = run
        self._target = target
        self._cores = cores
        self._ended = ended
        self._worker: Spawned | None = None
        self._job: Job | None = None
        self._since_s = time.monotonic()
        self._is_late = False
        self._is_stopped = False
        self._changing = threading.Lock()

    def run(self) -> None:
        """Feeds until there is nothing left."""
        try:
            self._take_next()
            tries = 0
            while self._job is not None and not self._is_stopped:
                before = self._job
                status = self._work()
                left = self._job_left()
                if left is None:
                    break
                tries = tries + 1 if left is before else 1
                result = ended_by_its_job(left, status)
                if result is None and (tries >= _TRIES or self._is_late):
                    result = self._fault(left, status)
                if result is not None:
                    self._run.keep(result)
                    self._take_next()
                    tries = 0
        except BaseException as error:
            self.failure = error
        finally:
            self._ended.put(self)

    def _job_left(self) -> Job | None:
        """Returns the job that the worker has not done, if one is to be done."""
        return None if self._is_stopped else self._job

    def _work(self) -> int:
        """Has one worker do what there is; returns how it ended."""
        with self._changing:
            if self._is_stopped:
                return 0
            said = partial(print_line, sys.stderr)
            worker = self._worker = Spawned(self._target, out=said, err=said)
            if self._cores:
                with suppress(OSError):  # it has died already: whoever listens is told
                    os.sched_setaffinity(worker.pid, self._cores)
        try:
            self._ask(worker)
            return worker.listen(partial(self._hear, worker))
        finally:
            with self._changing:
                self._worker = None

    def _ask(self, worker: Spawned) -> None:
        self._since_s = time.monotonic()
        self._is_late = False
        worker.say(msgspec.json.encode(self._job))

    def _hear(self, worker: Spawned, message: bytes) -> None:
        try:
            self._run.keep(decode_graded(message))
            self._take_next()
        except BaseException as error:  # not the worker's fault: it is ended, and the error told
            self.failure = error
            self.stop()
            return
        if self._job is None or self._is_stopped:
            worker.kill()
        else:
            self._ask(worker)

    def _take_next(self) -> None:
        self._job = None
        self._job = self._run.next_job()
        self._since_s = time.monotonic()

    def _fault(self, job: Job, status: int) -> Graded:
        why = "It took too long, and its worker was ended." if self._is_late else f"Its worker {how_it_ended(status)}."
        words = f"{why} That is a failure of the grader or of the lab; see what it printed."
        return without_marks(job, "fault", words)

    def end_if_later_than(self, limit_s: float) -> None:
        """Ends the worker if it has had its submission for so long."""
        with self._changing:
            if self._worker is not None and time.monotonic() - self._since_s > limit_s:
                self._is_late = True
                self._worker.kill()

    def stop(self) -> None:
        """Ends the worker, and takes nothing more."""
        with self._changing:
            self._is_stopped = True
            if self._worker is not None:
                with suppress(OSError):
                    self._worker.kill()
