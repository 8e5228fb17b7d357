"""Writer of the trace: a run's complete record, one JSON line per record, written during the run.

The node's thread only appends finished lines to a queue in memory. A flusher thread writes them every 50 ms, adds them
to the digest and syncs the file every second. A killed process therefore loses at most the last moments, and a power
loss at most what came after the last sync. Lines are written whole; a reader drops a truncated tail.

If the disk fails, a run in lock step ends, since it can be repeated with more room. A robot with real outputs, or on
the wall clock, continues without its recording (`fail_softly`), and its page `recording` reports what is lost.
"""

from __future__ import annotations

import errno
import math
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.errors import TraceError
from snr_sim.prelude.recorder import RECORDING_KEY
from snr_sim.prelude.task import Task, TaskType
from snr_sim.recording.atomic_files import FolderSync, TraceFile
from snr_sim.recording.node_trace import NodeTrace
from snr_sim.recording.records import Header, TraceInfo, TruthRecord, digest_of
from snr_sim.recording.references import REPEAT_WITHIN
from snr_sim.recording.sources import FOLDER as SOURCES
from snr_sim.recording.trace_listener import ListenerThread, TraceListener

if TYPE_CHECKING:
    from snr_sim.core.node import Node

FILE_NAME = "trace.jsonl"
FLUSH_PERIOD_S = 0.05
SYNC_PERIOD_S = 1.0
REPORT_PERIOD_S = 1.0  # of the page that reports what is lost
# Maximum backlog: minutes of a dive. A run in lock step then waits for the disk; any other stops its recording.
MAX_UNWRITTEN_BYTES = 64_000_000
VECTOR_DIGITS = 4  # decimals of arrows [m, N]: they are only drawn, and would fill half of a truth record
_PER_UNIT = 10.0**VECTOR_DIGITS
CLOSE_TIMEOUT_S = 5.0  # for a disk that hangs, at the end of a run that did not wait for it before
_SOURCE = "recorder"

_encode = msgspec.json.Encoder().encode


class TraceWriter:
    """Writer of one run's trace. Implements `Recorder`.

    Args:
        path: of the file, which must not exist: a recording is never overwritten.
        header: its second line.
        trace_info: its first line; by default it has the time and the command, but not the files.
        open_file: creates the file.

    Raises:
        TraceError: the file cannot be created.
    """

    def __init__(
        self,
        path: Path,
        header: Header,
        trace_info: TraceInfo | None = None,
        *,
        open_file: Callable[[Path], TraceFile] = TraceFile,
    ) -> None:
        self.path: Path = path
        self.seq: int = 0  # of the newest record
        self._lines: deque[tuple[float, bytes]] = deque()  # each with its time
        self._put_bytes = 0  # counted by the thread that puts
        self._taken_bytes = 0  # counted under `_losing` by the thread that takes; the difference is queued
        self._digest = digest_of()
        self._stored_pages: dict[tuple[str, bytes], tuple[int, int]] | None = {} if len(header.nodes) > 1 else None
        self._listener: ListenerThread | None = None
        self._whole_bytes = 0  # length of the file up to its last whole line
        self._unsynced_since_s = 0.0
        self._unsynced_lines = 0
        self._sync_due_s = time.monotonic() + SYNC_PERIOD_S
        self._sources = FolderSync(path.parent / SOURCES)
        self._writing = threading.Lock()
        self._closing = threading.Event()
        self._failure: OSError | None = None
        self._unrecorded_nodes: Sequence[Node] = ()  # nodes that continue without a recording
        self._losing = threading.Lock()  # of what is taken and of the numbers below; never held while a disk works
        self._lost = 0  # records
        self._lost_since_s = math.inf  # time of the first of them
        self._reported_s = -math.inf
        try:
            self._file = open_file(path)
        except OSError as error:
            raise TraceError(
                f"The trace {path} cannot be made: {error.strerror}.", fix="choose another folder with --out."
            ) from error
        first = _encode(trace_info or TraceInfo.now("", "")) + b"\n"
        second = _encode(header) + b"\n"
        _, self._failure = self._write(first + second)
        self._digest.update(second)
        if self._whole_bytes < len(first) + len(second):
            self._file.close()
            path.unlink()
            self._check()
        self._flusher = threading.Thread(target=self._flush_until_closed, name="trace-flusher", daemon=True)
        self._flusher.start()

    def for_node(self, name: str) -> NodeTrace:
        """Return the recorder of one node."""
        return NodeTrace(self, name)

    def fail_softly(self, nodes: Sequence[Node]) -> None:
        """Let these nodes continue if the disk fails: a robot should not stop because it cannot be recorded.

        From the first lost record on they receive a page `recording` every second: `since_s`, the time of that
        record; `lost`, the number of records; and the `reason`. The trace ends there with a whole line. Later records
        are not written, even if the disk has room again, because a trace has no gaps.
        """
        self._unrecorded_nodes = nodes

    def truth(self, now_s: float, truth: dict[str, Any]) -> None:
        """Record the plant's true state, see `Plant.truth`."""
        self.seq += 1
        vectors = {name: _round_vector(arrow) for name, arrow in truth["vectors"].items()}
        self.put(now_s, _encode(TruthRecord(self.seq, now_s, truth["poses"], vectors, truth["values"])))

    def find_repeat(self, key: str, values: bytes, seq: int, index: int) -> tuple[int, int] | None:
        """Return seq and index of an earlier `store_page` task with this key and values, and remember this one.

        None if there was none recently, or if the run has only one node: then pages never cross nodes.
        """
        stored = self._stored_pages
        if stored is None:
            return None
        page = (key, values)
        place = stored.get(page)
        stored[page] = (seq, index)
        if len(stored) > 4 * REPEAT_WITHIN:
            self._stored_pages = {one: at for one, at in stored.items() if at[0] >= seq - REPEAT_WITHIN}
        return place if place is not None and place[0] >= seq - REPEAT_WITHIN else None

    @property
    def digest(self) -> str:
        """BLAKE2b-256 of all that has been written, but for the first line; see `close`."""
        return self._digest.hexdigest()

    @property
    def loss(self) -> str:
        """What a run that continued without its recording has lost, as text; empty if nothing."""
        if not self._lost or self._failure is None:
            return ""
        return (
            f"The recording stops at t = {self._lost_since_s:.2f} s: {self._failure.strerror}. "
            f"The trace is whole up to there; {self._lost} records are lost."
        )

    def close(self) -> None:
        """Write what is left and close the file. Safe to call twice.

        Raises:
            TraceError: not everything could be written, and `fail_softly` was not called.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        self._flusher.join(CLOSE_TIMEOUT_S if self._unrecorded_nodes else None)
        if self._flusher.is_alive():
            self._give_up()  # a system call on the file may still block, and may never return
        else:
            self._flush()
            self._sync()
            self._file.close()
        if self._listener is not None:
            self._listener.close()
        if not self._unrecorded_nodes:
            self._check()

    def add_listener(self, listener: TraceListener) -> None:
        """Pass every record to a listener, too, on a separate thread; call it before the first record."""
        self._listener = ListenerThread(listener)

    def put(self, now_s: float, line: bytes) -> None:
        """Add a line to the trace.

        Raises:
            TraceError: an earlier line could not be written, and `fail_softly` was not called.
        """
        if self._failure is not None:
            if not self._unrecorded_nodes:
                self._check()
            self._count_lost(now_s, 1)
            self._report()
            if self._listener is None:
                return
        self._lines.append((now_s, line))
        self._put_bytes += len(line)
        if self._put_bytes - self._taken_bytes > MAX_UNWRITTEN_BYTES:
            if self._unrecorded_nodes:
                self._give_up()
            else:
                self._flush()

    def _check(self) -> None:
        if self._failure is not None:
            raise TraceError(
                f"The trace {self.path} could not be written on: {self._failure.strerror}. It is whole up to there.",
                fix="make room on the disk, or record to another one with --out.",
            ) from self._failure

    # What is lost

    def _give_up(self) -> None:
        """Drop the queued lines if the disk hangs."""
        if self._failure is None:
            self._failure = OSError(errno.ETIMEDOUT, "the disk is too slow, or does not answer")
        lines = self._take()
        if lines:
            self._count_lost(lines[0][0], len(lines))

    def _count_lost(self, since_s: float, count: int) -> None:
        """Count records that are not written to the file."""
        with self._losing:
            self._lost += count
            self._lost_since_s = min(self._lost_since_s, since_s)

    def _report(self) -> None:
        """Report to the nodes what is lost, at most once a period; thread-safe."""
        failure, now_s = self._failure, time.monotonic()
        with self._losing:
            if failure is None or not self._lost or now_s < self._reported_s + REPORT_PERIOD_S:
                return
            is_first, self._reported_s = self._reported_s < 0, now_s
            data = {"since_s": self._lost_since_s, "lost": self._lost, "reason": failure.strerror}
        if is_first and self._unrecorded_nodes:
            print_line(sys.stderr, f"{self.loss} The run continues.")
        for node in self._unrecorded_nodes:
            node.enqueue_input(Task(TaskType.store_page, RECORDING_KEY, [node.page(RECORDING_KEY, data)]), _SOURCE)

    # The flusher's

    def _flush_until_closed(self) -> None:
        while not self._closing.wait(FLUSH_PERIOD_S):
            self._flush()
            if time.monotonic() >= self._sync_due_s:
                self._sync()
            self._report()

    def _take(self) -> list[tuple[float, bytes]]:
        """Take the queued lines; thread-safe."""
        lines = self._lines
        with self._losing:
            taken = [lines.popleft() for _ in range(len(lines))]
            self._taken_bytes += sum(len(line) for _, line in taken)
        return taken

    def _flush(self) -> None:
        with self._writing:
            ready = self._take()
            if not ready:
                return
            if self._failure is None:
                # b"" at the end, so that the last line gets its newline, too
                written, error = self._write(b"\n".join([*(line for _, line in ready), b""]))
                self._digest.update(written)
                whole = written.count(b"\n")
                if not self._unsynced_lines:
                    self._unsynced_since_s = ready[0][0]
                self._unsynced_lines += whole
                if whole < len(ready):
                    self._count_lost(ready[whole][0], len(ready) - whole)
                if error is not None:  # else a disk that answered too late would undo `_give_up`
                    self._failure = error  # last: the first report counts all that is lost so far
            else:
                self._count_lost(ready[0][0], len(ready))  # queued while the disk failed
            if self._listener is not None:
                self._listener.give([line for _, line in ready])

    def _write(self, data: bytes) -> tuple[bytes, OSError | None]:
        """Write the data, or truncate the file to its last whole line.

        Returns what was written, and the failure.
        """
        view, failure = memoryview(data), None
        try:
            while view:
                view = view[self._file.write(view) :]
        except OSError as error:
            failure = error
            data = data[: data.rfind(b"\n", 0, len(data) - len(view)) + 1]
            with suppress(OSError):  # some disks fail here, too; a reader skips a truncated last line
                self._file.truncate(self._whole_bytes + len(data))
        self._whole_bytes += len(data)
        return data, failure

    def _sync(self) -> None:
        """Sync the file to the disk; if that fails, everything since the last sync counts as lost."""
        with self._writing:
            self._sync_due_s = time.monotonic() + SYNC_PERIOD_S
            if not self._unsynced_lines:
                return
            with suppress(OSError):  # the run continues without copies
                self._sources.sync()
            try:
                self._file.sync()
            except OSError as error:
                self._count_lost(self._unsynced_since_s, self._unsynced_lines)
                if self._failure is None:
                    self._failure = error
            self._unsynced_lines = 0


def _round_vector(arrow: Sequence[float]) -> list[float]:
    """Return the numbers of an arrow rounded to VECTOR_DIGITS; a zero keeps the sign of the number.

    Python's `round` to a digit formats a text internally and takes three times as long.
    """
    try:
        return [round(number * _PER_UNIT) / _PER_UNIT or 0.0 * number for number in arrow]
    except (ValueError, OverflowError):  # a number is not finite, or overflows when scaled
        return [round(number, VECTOR_DIGITS) for number in arrow]
