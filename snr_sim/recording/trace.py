"""The trace: a run's record of truth, one JSON line per record, written as it happens.

The node's thread only appends finished lines to a queue in memory; a flusher thread writes them out every 50 ms and
adds them to the digest. So a killed process loses at most the last moments, and no line is ever half written by us;
a reader drops a last line that the disk or the kill cut short.
"""

from __future__ import annotations

import os
import sys
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

import msgspec

from snr_sim.prelude.errors import TraceError
from snr_sim.recording.node_trace import NodeTrace
from snr_sim.recording.records import (
    Header,
    Opening,
    Record,
    TruthRecord,
    decode_record,
    digest_of,
)

FILE_NAME = "trace.jsonl"
FLUSH_PERIOD_S = 0.05
# A run that is faster than its disk waits here, instead of filling the memory.
MAX_UNWRITTEN_LINES = 200_000

_encode = msgspec.json.Encoder().encode


class Follower(Protocol):
    """Is shown a run while it is recorded, as a live view is."""

    def add(self, record: Record) -> None:
        """Takes a record."""
        ...

    def flush(self) -> None:
        """Is told that this was all for the moment."""
        ...


class TraceWriter:
    """Writes one run's trace. Keeps the `Recorder` promise.

    Args:
        path: of the file, which must not exist: a recording is never overwritten.
        header: its second line.
        opening: its first one; if not given, it says when and by which command, but not of which files.

    Raises:
        TraceError: the file cannot be made.
    """

    def __init__(self, path: Path, header: Header, opening: Opening | None = None) -> None:
        self.path = path
        self.seq = 0  # of the newest record
        self._lines: deque[bytes] = deque()
        self._digest = digest_of()
        self._failure: OSError | None = None
        self._follower: Follower | None = None
        self._whole_bytes = 0  # length of the file up to its last whole line
        self._writing = threading.Lock()
        self._closing = threading.Event()
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except OSError as error:
            raise TraceError(
                f"The trace {path} cannot be made: {error.strerror}.", fix="choose another folder with --out."
            ) from error
        first = _encode(opening or Opening.now("", "")) + b"\n"
        second = _encode(header) + b"\n"
        self._write(first + second)
        self._digest.update(second)
        if self._whole_bytes < len(first) + len(second):
            os.close(self._file)
            path.unlink()
            self._check()
        self._flusher = threading.Thread(target=self._flush_until_closed, name="trace-flusher", daemon=True)
        self._flusher.start()

    def for_node(self, name: str) -> NodeTrace:
        """Returns the recorder of one node."""
        return NodeTrace(self, name)

    def truth(self, now_s: float, truth: dict[str, Any]) -> None:
        """Takes down the plant's true state, see `Plant.truth`."""
        self.seq += 1
        self.put(_encode(TruthRecord(self.seq, now_s, truth["poses"], truth["arrows"], truth["values"])))

    @property
    def digest(self) -> str:
        """BLAKE2b-256 of all that has been written, but for the first line; see `close`."""
        return self._digest.hexdigest()

    def close(self) -> None:
        """Writes what is left and closes the file. Safe to call twice.

        Raises:
            TraceError: not everything could be written.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        self._flusher.join()
        self._flush()
        os.close(self._file)
        self._check()

    def follow(self, follower: Follower) -> None:
        """Has every record from now on given to a follower, too, on the thread that writes the file."""
        self._follower = follower

    def put(self, line: bytes) -> None:
        """Adds a line to the trace.

        Raises:
            TraceError: an earlier one could not be written.
        """
        self._lines.append(line)
        if self._failure is not None:
            self._check()
        if len(self._lines) > MAX_UNWRITTEN_LINES:
            self._flush()

    def _check(self) -> None:
        if self._failure is not None:
            raise TraceError(
                f"The trace {self.path} could not be written on: {self._failure.strerror}. It is whole up to there.",
                fix="make room on the disk, or record to another one with --out.",
            ) from self._failure

    def _flush_until_closed(self) -> None:
        while not self._closing.wait(FLUSH_PERIOD_S):
            self._flush()

    def _flush(self) -> None:
        lines = self._lines
        with self._writing:
            ready = [lines.popleft() for _ in range(len(lines))]
            if not ready or self._failure is not None:
                return
            # b"" at the end, so that the last line gets its newline, too
            self._digest.update(self._write(b"\n".join([*ready, b""])))
            self._show(ready)

    def _show(self, lines: Sequence[bytes]) -> None:
        if self._follower is None:
            return
        try:
            for line in lines:
                self._follower.add(decode_record(line))
            self._follower.flush()
        except Exception as error:  # a view that fails must not cost the recording
            self._follower = None
            print(f"The live view has stopped: {error}. The run goes on and is recorded.", file=sys.stderr)

    def _write(self, data: bytes) -> bytes:
        """Writes all of it, or cuts the file back to its last whole line and remembers the failure.

        Returns what was written.
        """
        view = memoryview(data)
        try:
            while view:
                view = view[os.write(self._file, view) :]
        except OSError as error:
            self._failure = error
            data = data[: data.rfind(b"\n", 0, len(data) - len(view)) + 1]
            with suppress(OSError):  # some disks refuse even that; a reader leaves out a last line that is cut
                os.ftruncate(self._file, self._whole_bytes + len(data))
        self._whole_bytes += len(data)
        return data
