"""Workers on a dask cluster: the only module that imports dask.distributed.

A submission travels with the lab and the secret as bytes, so workers need no common disk, only this version of snr_sim
and the sandbox. Dask gives the jobs of a dead worker to another one. Only a few submissions are in transit at a time,
so the scheduler's memory does not grow with the class.
"""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import msgspec

from snr_sim import __version__
from snr_sim.grading.batch.submission_import import remove
from snr_sim.grading.batch.worker import Job, ungraded_result
from snr_sim.grading.batch.workers import WorkerProcess
from snr_sim.grading.reports.results import Graded, decode_graded, encode_graded
from snr_sim.prelude.errors import MissingExtraError, SnrError

RETRIES = 2  # of a submission whose grading raised on a worker; dask itself retries after a worker's death
MAX_RUNS_BYTES = 16 * 2**20
_AHEAD = 2  # submissions in transit per thread of the cluster
_CONNECT_S = 10


class ClusterJob(msgspec.Struct, frozen=True):
    """A job with all that it needs: files by relative name."""

    job: Job  # its paths are filled in where it arrives
    version: str  # of snr_sim that it needs
    lab: dict[str, bytes]
    submission: dict[str, bytes]


class ClusterResult(msgspec.Struct, frozen=True):
    """Result of a parcel: the record, and the recorded runs by relative name."""

    graded: bytes
    runs: dict[str, bytes]


_decode_job = msgspec.msgpack.Decoder(ClusterJob).decode
_decode_result = msgspec.msgpack.Decoder(ClusterResult).decode


class ClusterWorkers:
    """The workers of a cluster, of which `client` is a connected one of dask.distributed."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._executor = client.get_executor(pure=False, retries=RETRIES)

    @property
    def ahead(self) -> int:
        """How many submissions are handed out at a time."""
        return _AHEAD * (sum(self._client.nthreads().values()) or 1)

    def submit(self, job: Job) -> Future[bytes]:
        """Send a submission to the cluster."""
        content = ClusterJob(job, __version__, _files_of(Path(job.lab).parent), _files_of(Path(job.folder)))
        future: Future[bytes] = self._executor.submit(grade_cluster_job, msgspec.msgpack.encode(content))
        return future

    def result(self, future: Future[Any], job: Job) -> Graded:
        """Return the result of a future; recorded runs are written to the job's folder."""
        error = future.exception()
        if error is not None:
            words = f"The cluster could not grade it: {type(error).__name__}: {error}"
            return ungraded_result(job, "grader_error", words)
        returned = _decode_result(future.result())
        _write(Path(job.runs), returned.runs)
        return decode_graded(returned.graded)


@contextmanager
def connected(address: str) -> Iterator[ClusterWorkers]:
    """Yield the workers of the cluster of a dask scheduler's address, such as tcp://127.0.0.1:8786.

    Raises:
        MissingExtraError: dask.distributed is not installed.
        SnrError: no scheduler answers at this address.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise MissingExtraError("distributed", "grade-cluster") from error
    protocol, _, place = address.rpartition("://")
    if protocol not in ("", "tcp", "tls", "ws", "wss") or ":" not in place:
        raise SnrError(
            f"'{address}' is not the address of a dask scheduler.",
            fix="use the address that the scheduler prints: tcp://HOST:8786.",
        )
    try:
        client = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise SnrError(f"No dask scheduler answers at {address}: {error}.", fix="start one: dask scheduler.") from error
    try:
        yield ClusterWorkers(client)
    finally:
        client.close()


def _files_of(folder: Path, limit_bytes: float = float("inf")) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    for path in sorted(folder.rglob("*")) if folder.is_dir() else []:
        if path.is_file() and "__pycache__" not in path.parts:
            limit_bytes -= path.stat().st_size
            if limit_bytes >= 0:
                found[str(path.relative_to(folder))] = path.read_bytes()
    return found


def _write(folder: Path, files: dict[str, bytes]) -> None:
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


# On a worker of the cluster


def grade_cluster_job(cluster_job: bytes) -> bytes:
    """Grade a parcel; dask calls it on a worker. A child process of the worker does the grading."""
    content = _decode_job(cluster_job)
    if content.version != __version__:
        words = f"This worker has snr_sim {__version__}, and not {content.version}."
        return _encode_result(ungraded_result(content.job, "grader_error", words), Path("/nonexistent"))
    # In dask's own folder for this worker: the next worker removes the files of a killed one there.
    own = importlib.import_module("distributed").get_worker().local_directory
    place = Path(tempfile.mkdtemp(prefix="snr_grade_", dir=own))
    place.chmod(0o711)
    try:
        lab, runs = place / Path(content.job.lab).parent.name, place / "runs"
        _write(lab, content.lab)
        (place / "submission").mkdir()
        _write(place / "submission", content.submission)
        paths = {"lab": str(lab / "checks.py"), "folder": str(place / "submission"), "runs": str(runs)}
        job = msgspec.structs.replace(content.job, **paths)
        with closing(WorkerProcess(set())) as worker:  # a crash there is not the cluster's
            return _encode_result(worker.grade(job), runs)
    finally:
        remove(place)


def _encode_result(graded: Graded, runs: Path) -> bytes:
    return msgspec.msgpack.encode(ClusterResult(encode_graded(graded), _files_of(runs, MAX_RUNS_BYTES)))
