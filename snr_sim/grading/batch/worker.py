"""Process that grades one submission after the other. It belongs to the grader: students' programs are its children.

It receives jobs on the connection to its parent and answers there. If the parent ends, it ends at once.
"""

from __future__ import annotations

import math
import os
import queue
import resource
import tempfile
import threading
from contextlib import suppress
from functools import cache
from multiprocessing.connection import Connection
from pathlib import Path

import msgspec

from snr_sim import __version__
from snr_sim.core.source_location import describe_error
from snr_sim.grading.grade import grade_submission, resolve_isolation
from snr_sim.grading.lab.lab import Lab, load_lab
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.reports.results import Graded, Isolation, RequestedIsolation, Status, encode_graded
from snr_sim.grading.sandbox.sandbox import Limits
from snr_sim.prelude.errors import SnrError

# Of the grader's own process, for one submission. A lab that trains takes 1.3 s of it with its reference (and 2.2 s in
# students' processes, which have limits of their own): room for a hundredfold slower computer, and for hard cases.
JOB_CPU_S = 900
MEMORY_BYTES = 8 << 30  # of address space, of which every thread of numpy's reserves some


class Job(msgspec.Struct, frozen=True):
    """A submission to grade."""

    name: str
    lab: str  # path of the lab's checks.py
    folder: str  # of the submission, imported
    secret: bytes  # from which hidden cases are drawn
    isolation: RequestedIsolation
    runs: str  # where recorded runs go


_decode_job = msgspec.json.Decoder(Job).decode


def serve(line: Connection) -> int:
    """Answer jobs until the parent closes the connection; `SpawnedProcess` calls it."""
    jobs: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(line, jobs), daemon=True).start()
    fork_server: ForkServer | None = None
    while True:
        job = _decode_job(jobs.get())
        # A worker may be killed at any moment and then removes nothing. So all its temporary folders are in the
        # class's place, which the grader removes.
        tempfile.tempdir = str(Path(job.folder).parent)
        # Where all submissions of a class get their processes, which die with this one.
        fork_server = fork_server or ForkServer(_isolation_here(job.isolation), Limits())
        limit_resources()
        line.send_bytes(encode_graded(grade(job, fork_server)))


def limit_resources() -> None:
    """Bound the CPU time and memory that this process takes for its next job; the wall time is for `workers.py`.

    Students' programs have limits of their own, far lower. Whatever holds the grader itself costs its submission a
    mark, then, and not the class: the kernel ends the worker with SIGXCPU, and memory that is refused is a fault.
    """
    used = resource.getrusage(resource.RUSAGE_SELF)
    cpu_s = math.ceil(used.ru_utime + used.ru_stime) + JOB_CPU_S
    for limit, max_value in ((resource.RLIMIT_CPU, cpu_s), (resource.RLIMIT_AS, MEMORY_BYTES)):
        hard = resource.getrlimit(limit)[1]
        with suppress(OSError, ValueError):  # a system that has no such limit
            resource.setrlimit(limit, (max_value if hard == resource.RLIM_INFINITY else min(max_value, hard), hard))


def _listen(line: Connection, jobs: queue.SimpleQueue[bytes]) -> None:
    while True:
        try:
            jobs.put(line.recv_bytes())
        except (EOFError, OSError):
            os._exit(0)  # the sandboxes end with this process


def grade(job: Job, fork_server: ForkServer | None = None) -> Graded:
    """Grade a job's submission; a failure that is not the student's is returned as a fault."""
    title = ""
    try:
        lab = _lab(job.lab)
        title, folder, runs = lab.title, Path(job.folder), Path(job.runs)
        return grade_submission(
            lab, folder, job.secret, job.isolation, name=job.name, out=runs, fork_server=fork_server
        )
    except Exception as error:
        what = describe_error(error, f"while the submission '{job.name}' was graded")
        return ungraded_result(job, "grader_error", what, title)


@cache
def _lab(path: str) -> Lab:
    return load_lab(Path(path))


def ungraded_result(job: Job, status: Status, error: str, title: str = "") -> Graded:
    """Return the result of a submission that was not run, with the isolation that its program would have had.

    `status` is "rejected" if the submission is the cause, "grader_error" if the grader is.
    """
    name = Path(job.lab).parent.name
    return Graded(
        submission=job.name,
        lab=name,
        title=title or name,
        isolation=_isolation_here(job.isolation),
        includes_hidden=True,
        version=__version__,
        status=status,
        error=error,
    )


@cache
def _isolation_here(requested: RequestedIsolation) -> Isolation:
    """Return the isolation that this computer supports; if that cannot be determined, the sandbox."""
    try:
        return resolve_isolation(requested)
    except (SnrError, OSError):  # the cause of a failed grading may prevent this, too: no memory, no processes
        return "sandbox"
