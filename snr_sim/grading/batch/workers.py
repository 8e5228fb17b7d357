"""Worker processes on this computer: each grades one submission after another, and is replaced when it dies.

A worker and the program that it grades take turns, never both at work. So where every core has its worker, each worker
shares its core with its program: their messages wake no other core, and the caches stay warm.

It is not a ProcessPoolExecutor: there one process that dies breaks the pool, and with it every submission in progress.
Workers end with the process that started them, and sandboxes with them. One that a submission blocks is ended by the
kernel for its CPU time (`worker.py`) and here for its wall time.
"""

from __future__ import annotations

import os
import signal
import sys
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from typing import Any

import msgspec

from snr_sim.core.process.spawn import SpawnedProcess, describe_exit
from snr_sim.core.standard_streams import print_line
from snr_sim.grading.batch.worker import JOB_CPU_S, Job, ungraded_result
from snr_sim.grading.reports.results import Graded, decode_graded
from snr_sim.prelude.waiting import TimedQueue

TIMEOUT_S = 3600.0  # of wall time for one submission; far longer than the limits of all its cases together
_MAX_TRIES = 2
_WORKER = "snr_sim.grading.batch.worker:serve"


class WorkerProcess:
    """A process that grades; started when it is needed. Any thread may close it, in the end.

    Args:
        cores: that it stays on; if empty, any.
        limit_s: wall time for one submission.
        target: main function of the process.
    """

    def __init__(self, cores: set[int], limit_s: float = TIMEOUT_S, target: str = _WORKER) -> None:
        self._cores = cores
        self._limit_s = limit_s
        self._target = target
        self._answers: TimedQueue[bytes | int] = TimedQueue()  # results, and the exit status after the last one
        self._process: SpawnedProcess | None = None
        self._listener: Thread | None = None
        self._is_closed = False
        self._changing = Lock()

    def grade(self, job: Job) -> Graded:
        """Return the result of a submission.

        If the process dies, it is tried once more in a fresh one. If that dies, too, the result is a fault, and no
        mark; at once if it took too long, by the CPU time or the wall clock.
        """
        reason = ""
        for _ in range(_MAX_TRIES):
            answer = self._ask(job)
            if isinstance(answer, bytes):
                return decode_graded(answer)
            if answer == -signal.SIGXCPU:
                words = f"The grader worked on it for more than {JOB_CPU_S} s, and was ended."
                return ungraded_result(job, "grader_error", words)
            if answer is None:
                reason = "It took too long, and its worker was ended."
                break
            reason = f"Its worker {describe_exit(answer)}."
        words = f"{reason} That is a failure of the grader or of the lab; see what it printed."
        return ungraded_result(job, "grader_error", words)

    def close(self) -> None:
        """End the process; a submission being graded has no result."""
        with self._changing:
            self._is_closed = True
            if self._process is not None:
                self._process.kill()
        if self._listener is not None:
            self._listener.join()

    def _ask(self, job: Job) -> bytes | int | None:
        """Return the answer of the process, its exit status if it has ended, or None if it took too long."""
        with self._changing:
            if self._is_closed:
                return 0
            process = self._process = self._process or self._start_process()
        process.send(msgspec.json.encode(job))
        try:
            answer: bytes | int | None = self._answers.get(self._limit_s)
        except Empty:
            process.kill()
            answer = None
            while isinstance(self._answers.get(), bytes):
                pass  # it had come too late
        if not isinstance(answer, bytes):
            with self._changing:
                self._process = None
        return answer

    def _start_process(self) -> SpawnedProcess:
        print_output = partial(print_line, sys.stderr)
        process = SpawnedProcess(self._target, out=print_output, err=print_output)
        if self._cores:
            with suppress(OSError):  # it has died already, and the listener reports it
                os.sched_setaffinity(process.pid, self._cores)
        self._listener = Thread(target=self._listen, args=(process,), daemon=True)
        self._listener.start()
        return process

    def _listen(self, process: SpawnedProcess) -> None:
        status = 1
        try:
            status = process.receive_loop(self._answers.put)
        finally:
            self._answers.put(status)


class LocalWorkers:
    """So many worker processes, and a thread for each that waits for it; use `with`. Arguments: `WorkerProcess`."""

    def __init__(self, jobs: int, limit_s: float = TIMEOUT_S, target: str = _WORKER) -> None:
        self._workers = [WorkerProcess(cores, limit_s, target) for cores in _cores_of(jobs)]
        self._idle: SimpleQueue[WorkerProcess] = SimpleQueue()
        for worker in self._workers:
            self._idle.put(worker)
        self._threads = ThreadPoolExecutor(jobs)
        self.ahead: int = 2 * jobs  # so that the next ones are imported while these are graded

    def __enter__(self) -> LocalWorkers:
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.close()
        self._threads.shutdown()

    def submit(self, job: Job) -> Future[Graded]:
        """Have the next idle worker grade a submission."""
        return self._threads.submit(self._grade, job)

    def result(self, future: Future[Any], job: Job) -> Graded:
        """Return the result of a future of `submit` for a job."""
        graded: Graded = future.result()
        return graded

    def _grade(self, job: Job) -> Graded:
        worker = self._idle.get()
        try:
            return worker.grade(job)
        finally:
            self._idle.put(worker)


def _cores_of(jobs: int) -> list[set[int]]:
    """Return for each worker the core that it stays on; none if it may go anywhere, as cores are left over."""
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    if not cores or jobs < len(cores):
        return [set() for _ in range(jobs)]
    return [{cores[i % len(cores)]} for i in range(jobs)]
