"""Grades a class on a dask cluster: the one file that imports dask.distributed.

A submission travels with the lab and the secret as bytes, so workers need no common disk, only this version of snr_sim
and the sandbox. Dask gives what a dead worker had to another one. Only a few submissions are on their way at a time,
so the scheduler's memory does not grow with the class.
"""

from __future__ import annotations

import importlib
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from snr_sim import __version__
from snr_sim.core.process.spawn import Spawned, how_it_ended, print_line
from snr_sim.grading.batch.class_run import ClassRun
from snr_sim.grading.batch.intake import remove
from snr_sim.grading.batch.worker import Job, ended_by_its_job, without_marks
from snr_sim.grading.reports.results import Graded, decode_graded, encode_graded
from snr_sim.prelude.errors import MissingExtra, SnrError

RETRIES = 2  # of a submission whose grading raised on a worker; one whose worker died is dask's own affair
MAX_RUNS_BYTES = 16 * 2**20
_AHEAD = 2  # submissions on their way per thread of the cluster
_CONNECT_S = 10
_WORKER = "snr_sim.grading.batch.worker:serve"


class Parcel(msgspec.Struct, frozen=True):
    """A job with all that it needs.

    Args:
        job: its paths are filled in where it arrives.
        kit: version of snr_sim that it needs.
        lab, submission: their files by relative name.
    """

    job: Job
    kit: str
    lab: dict[str, bytes]
    submission: dict[str, bytes]


class Returned(msgspec.Struct, frozen=True):
    """What comes back: the record, and the recorded runs by relative name."""

    graded: bytes
    runs: dict[str, bytes]


_decode_parcel = msgspec.msgpack.Decoder(Parcel).decode
_decode_returned = msgspec.msgpack.Decoder(Returned).decode


def grade_on_cluster(run: ClassRun, client: Any) -> None:
    """Grades all that a run has; returns when it is done.

    Args:
        run: gives the submissions and keeps the results.
        client: of the cluster, from `connected`.
    """
    under_way: dict[Any, Job] = {}
    arriving = importlib.import_module("distributed").as_completed(loop=client.loop)

    def send_more() -> None:
        threads = sum(client.nthreads().values()) or 1
        while len(under_way) < _AHEAD * threads:
            job = run.next_job()
            if job is None:
                return
            future = client.submit(grade_parcel, packed(job), pure=False, retries=RETRIES)
            under_way[future] = job
            arriving.add(future)

    send_more()
    for future in arriving:
        run.keep(_unpacked(future, under_way.pop(future)))
        send_more()


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """Yields a client of a cluster.

    Args:
        address: of a dask scheduler, such as tcp://127.0.0.1:8786.

    Raises:
        MissingExtra: dask.distributed is not installed.
        SnrError: nobody answers there.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise MissingExtra("distributed", "grade-cluster") from error
    protocol, _, place = address.rpartition("://")
    if protocol not in ("", "tcp", "tls", "ws", "wss") or ":" not in place:
        raise SnrError(
            f"'{address}' is not the address of a dask scheduler.", fix="as it says itself: tcp://HOST:8786."
        )
    try:
        client = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise SnrError(f"No dask scheduler answers at {address}: {error}.", fix="start one: dask scheduler.") from error
    try:
        yield client
    finally:
        client.close()


def packed(job: Job) -> bytes:
    """Returns a job as bytes."""
    lab = _files_of(Path(job.lab).parent)
    return msgspec.msgpack.encode(Parcel(job, __version__, lab, _files_of(Path(job.folder))))


def _files_of(folder: Path, limit_bytes: float = float("inf")) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    for path in sorted(folder.rglob("*")) if folder.is_dir() else []:
        if path.is_file() and "__pycache__" not in path.parts:
            limit_bytes -= path.stat().st_size
            if limit_bytes >= 0:
                found[str(path.relative_to(folder))] = path.read_bytes()
    return found


def _unpacked(future: Any, job: Job) -> Graded:
    """Returns what a future holds; recorded runs are written where the job wants them."""
    error = future.exception()
    if error is not None:
        return without_marks(job, "fault", f"The cluster could not grade it: {type(error).__name__}: {error}")
    returned = _decode_returned(future.result())
    _write(Path(job.runs), returned.runs)
    return decode_graded(returned.graded)


def _write(folder: Path, files: dict[str, bytes]) -> None:
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


# On a worker of the cluster


def grade_parcel(parcel: bytes) -> bytes:
    """Grades what came; dask calls it on a worker. The grading itself is done by a process below it."""
    content = _decode_parcel(parcel)
    if content.kit != __version__:
        words = f"This worker has snr_sim {__version__}, and not {content.kit}."
        return _returned(without_marks(content.job, "fault", words), Path("/nonexistent"))
    # In dask's own folder for this worker: what a killed one leaves there is removed by the next.
    own = importlib.import_module("distributed").get_worker().local_directory
    place = Path(tempfile.mkdtemp(prefix="snr_grade_", dir=own))
    place.chmod(0o711)
    try:
        lab, runs = place / Path(content.job.lab).parent.name, place / "runs"
        _write(lab, content.lab)
        (place / "submission").mkdir()
        _write(place / "submission", content.submission)
        job = msgspec.structs.replace(
            content.job, lab=str(lab / "checks.py"), folder=str(place / "submission"), runs=str(runs)
        )
        return _returned(_graded_below(job), runs)
    finally:
        remove(place)


def _returned(graded: Graded, runs: Path) -> bytes:
    return msgspec.msgpack.encode(Returned(encode_graded(graded), _files_of(runs, MAX_RUNS_BYTES)))


def _graded_below(job: Job) -> Graded:
    """Has a process of its own grade, so that a crash there is not the cluster's."""
    answers: list[bytes] = []
    said = partial(print_line, sys.stderr)
    worker = Spawned(_WORKER, out=said, err=said)

    def hear(message: bytes) -> None:
        answers.append(message)
        worker.kill()

    worker.say(msgspec.json.encode(job))
    status = worker.listen(hear)
    if not answers and (result := ended_by_its_job(job, status)) is not None:
        return result
    if not answers:
        raise SnrError(f"The process that graded '{job.name}' {how_it_ended(status)}.")
    return decode_graded(answers[0])
