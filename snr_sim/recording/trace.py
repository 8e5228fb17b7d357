"""The trace: a run's record of truth, one JSON line per record, written as it happens.

The node's thread only appends finished lines to a queue in memory; a flusher thread writes them out every 50 ms and
adds them to the digest. So a killed process loses at most the last moments, and no line is ever half written by us;
a reader drops a last line that the disk or the kill cut short.
"""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

import msgspec
from msgspec import Raw

from snr_sim.prelude.errors import SnrError, TraceError
from snr_sim.prelude.page import Page
from snr_sim.prelude.recorder import Handled, Ticket
from snr_sim.prelude.task import Task, TaskType
from snr_sim.prelude.values import MARK, encode_value
from snr_sim.recording.records import (
    BeginRecord,
    By,
    EndRecord,
    ErrorRecord,
    Header,
    InputRecord,
    PageRecord,
    Record,
    Returned,
    TaskRecord,
    TruthRecord,
)

FILE_NAME = "trace.jsonl"
FLUSH_PERIOD_S = 0.05
# A run that is faster than its disk waits here, instead of filling the memory.
MAX_UNWRITTEN_LINES = 200_000

_encode = msgspec.json.Encoder().encode
_NO_VALUES = b"[]"


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
        header: its first line.

    Raises:
        TraceError: the file cannot be made.
    """

    def __init__(self, path: Path, header: Header) -> None:
        self.path = path
        self.seq = 0  # of the newest record
        self._lines: deque[bytes] = deque()
        # The scene is nearly all of the header, and the header is encoded twice: for the digest and for the file.
        header = msgspec.structs.replace(header, scene=Raw(_encode(header.scene)))
        self._digest = digest_of_header(header)
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
        self._write(_encode(header) + b"\n")
        if not self._whole_bytes:
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
        """BLAKE2b-256 of all that has been written, but for wall-clock fields; see `close`."""
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
            self._write(b"\n".join([*ready, b""]))  # so that the last line gets its newline, too
            self._show(ready)

    def _show(self, lines: Sequence[bytes]) -> None:
        if self._follower is None:
            return
        try:
            for line in lines:
                self._follower.add(_decode_record(line))
            self._follower.flush()
        except Exception as error:  # a view that fails must not cost the recording
            self._follower = None
            print(f"The live view has stopped: {error}. The run goes on and is recorded.", file=sys.stderr)

    def _write(self, data: bytes) -> None:
        """Writes all of it, or cuts the file back to its last whole line and remembers the failure."""
        view = memoryview(data)
        try:
            while view:
                view = view[os.write(self._file, view) :]
        except OSError as error:
            self._failure = error
            data = data[: data.rfind(b"\n", 0, len(data) - len(view)) + 1]
            with suppress(OSError):  # some disks refuse even that; a reader leaves out a last line that is cut
                os.ftruncate(self._file, self._whole_bytes + len(data))
        if self._whole_bytes:  # the header is in the digest without its wall-clock part
            self._digest.update(data)
        self._whole_bytes += len(data)


def encode_values(task: Task) -> bytes:
    """Returns the JSON of the list of values a task carries."""
    values = task.val_list
    if not values:
        return _NO_VALUES
    try:
        if len(values) == 1 and type(values[0]) is Page:
            return b"[" + values[0].serialize() + b"]"
        return encode_value(list(values))
    except Exception as error:  # it contains itself, or cannot be looked into; a run goes on, recorded or not
        reason = error.message if isinstance(error, SnrError) else f"{type(error).__name__}: {error}"
        return encode_value([{MARK: "object", "type": "not recorded", "fields": {"because": reason}}])


def id_in_words(task: Task) -> tuple[str, str]:
    """Returns a task's type and name; as text also where they are none, which the node is about to complain about."""
    kind: Any = task.type
    name: Any = task.name
    if isinstance(kind, str) and isinstance(name, str):
        return kind, name
    return str(kind), str(name)


def digest_of_header(header: Header) -> hashlib.blake2b:
    """Returns a BLAKE2b-256 digest that has taken in the header, but for when and from which folders it was run."""
    names = {"scenario": Path(header.scenario).stem, "controller": Path(header.controller).stem}
    return hashlib.blake2b(_encode(msgspec.structs.replace(header, wall={}, **names)), digest_size=32)


class NodeTrace:
    """Writes one node's records. Keeps the `NodeRecorder` promise."""

    def __init__(self, writer: TraceWriter, node: str) -> None:
        self._writer = writer
        self._node = node
        self._newest = 0  # seq of this node's newest record

    def begun(self, now_s: float, component: str, scheduled: Sequence[Task]) -> list[Ticket]:
        """Takes down what a component scheduled in `begin`."""
        seq = self._next_seq()
        tickets: list[Ticket] = []
        returned = _returned(scheduled, seq, tickets)
        self._writer.put(_encode(BeginRecord(seq, now_s, self._node, component, returned)))
        return tickets

    def input(self, now_s: float, source: str, task: Task) -> Ticket:
        """Takes down a task that entered through the door."""
        seq = self._next_seq()
        values = encode_values(task)
        record = InputRecord(seq, now_s, self._node, source, *id_in_words(task), Raw(values))
        self._writer.put(_encode(record))
        return (task, seq, 0, values)

    def task(self, now_s: float, ticket: Ticket, handled: Sequence[Handled]) -> list[Ticket]:
        """Takes down an executed task; returns a ticket for each task its handlers returned, in order."""
        writer = self._writer
        self._newest = writer.seq = seq = writer.seq + 1
        task, cause, nth, values = ticket
        tickets: list[Ticket] = []
        by = [By(label[0], label[1], _returned(outputs, seq, tickets)) for label, outputs in handled]
        kind = PageRecord if task.type is TaskType.store_page else TaskRecord
        writer.put(_encode(kind(seq, now_s, self._node, *id_in_words(task), Raw(values), cause, nth, by)))
        return tickets

    def error(self, now_s: float, component: str, message: str) -> None:
        """Takes down what went wrong in a component, just now."""
        cause = self._newest
        self._writer.put(_encode(ErrorRecord(self._next_seq(), now_s, self._node, cause, component, message)))

    def end(self, now_s: float, reason: str, summary: dict[str, Any]) -> None:
        """Takes down that the node has ended, and why."""
        self._writer.put(_encode(EndRecord(self._next_seq(), now_s, self._node, reason, summary)))

    def _next_seq(self) -> int:
        self._newest = self._writer.seq = self._writer.seq + 1
        return self._newest


def _returned(tasks: Sequence[Task], seq: int, tickets: list[Ticket]) -> list[Returned]:
    """Returns tasks as they stand in a record, and adds a ticket for each."""
    returned = []
    for task in tasks:
        values = encode_values(task)
        tickets.append((task, seq, len(tickets), values))
        returned.append(Returned(*id_in_words(task), Raw(values)))
    return returned


class Trace:
    """A recorded run, read back.

    Args:
        path: of the file.
        header: its first line.
        records: all others, in order.
        digest: as the writer computed it.
        is_cut: the file ends in a line that was cut short; it was left out.
    """

    def __init__(self, path: Path, header: Header, records: list[Record], digest: str, is_cut: bool) -> None:
        self.path = path
        self.header = header
        self.records = records
        self.digest = digest
        self.is_cut = is_cut

    @property
    def is_ended(self) -> bool:
        """Whether every node of the run has its end record."""
        return {record.node for record in self.records if isinstance(record, EndRecord)} >= set(self.header.nodes)


def encode_record(record: Record) -> bytes:
    """Returns a record as it stands in the file, without the newline."""
    return _encode(record)


_decode_header = msgspec.json.Decoder(Header).decode
_decode_record = msgspec.json.Decoder(Record).decode
_decode_any = msgspec.json.Decoder().decode


def read_trace(path: Path) -> Trace:
    """Reads a trace, up to its last whole record.

    Raises:
        TraceError: there is none, it is of another version, or it is damaged before its last line.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise TraceError(f"The trace {path} cannot be read: {error.strerror}.", fix="name a run folder.") from error
    lines = data.split(b"\n")
    tail = lines.pop()  # what follows the last newline: nothing, unless the file was cut
    if not lines:
        raise TraceError(f"The trace {path} has no whole line.", fix="the run was cut before it began; run it again.")
    header = _read_header(path, lines[0])
    _check_text(path, lines)
    digest = digest_of_header(header)
    digest.update(data[len(lines[0]) + 1 : len(data) - len(tail)])
    records = []
    for number, line in enumerate(lines[1:], start=2):
        try:
            records.append(_decode_record(line))
        except msgspec.DecodeError as error:
            raise TraceError(
                f"{path}, line {number} is not a record: {error}. It reads: {line[:100]!r}",
                fix="the file was changed or damaged after the run; use an untouched copy, or run again.",
            ) from error
    _check_order(path, records)
    return Trace(path, header, records, digest.hexdigest(), is_cut=bool(tail))


def _read_header(path: Path, line: bytes) -> Header:
    from snr_sim.recording.records import SCHEMA

    try:
        fields = _decode_any(line)
    except (msgspec.DecodeError, UnicodeDecodeError):
        fields = None
    if not isinstance(fields, dict) or fields.get("kind") != "header":
        raise TraceError(f"{path} is not a trace: its first line is no header.", fix="name a run folder of `snr run`.")
    if fields.get("schema") != SCHEMA:
        raise TraceError(
            f"{path} has trace format {fields.get('schema')!r}, written by snr_sim {fields.get('kit')!r}; "
            f"this kit reads format {SCHEMA}.",
            fix="use the kit that wrote it, or run the scenario again.",
        )
    try:
        return _decode_header(line)
    except msgspec.DecodeError as error:
        raise TraceError(
            f"{path}: its header is damaged: {error}.", fix="use an untouched copy, or run again."
        ) from error


def _check_text(path: Path, lines: Sequence[bytes]) -> None:
    for number, line in enumerate(lines, start=1):
        if not line.isascii():
            try:
                line.decode()
            except UnicodeDecodeError as error:
                raise TraceError(
                    f"{path}, line {number} is not a record: {error}.", fix="use an untouched copy, or run again."
                ) from error


def _check_order(path: Path, records: Sequence[Record]) -> None:
    for place, record in enumerate(records, start=1):
        if record.seq != place:
            raise TraceError(
                f"{path}: record {place} has seq {record.seq}; a line was taken out, put in or moved.",
                fix="use an untouched copy, or run the scenario again.",
            )
