"""Reader of traces, with an error that explains why a trace cannot be used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import msgspec

from snr_sim.prelude.errors import TraceError
from snr_sim.prelude.values import JSON_ERRORS, no_garbage_collection
from snr_sim.recording.records import (
    SCHEMA,
    BeginRecord,
    EndRecord,
    ErrorRecord,
    Executed,
    Header,
    InputRecord,
    LogLineRecord,
    Record,
    TraceInfo,
    decode_beginning,
    decode_line,
    digest_of,
)
from snr_sim.recording.references import References
from snr_sim.recording.scene_check import check_scene

_decode_any = msgspec.json.Decoder().decode


@dataclass(eq=False)
class Trace:
    """A recorded run, read back.

    Args:
        path: of the file.
        trace_info: its first line.
        header: its second line.
        records: all others, in order.
        digest: as the writer computed it.
        is_truncated: whether the file has a truncated tail, from a crash or a power loss, which was skipped.
    """

    path: Path
    trace_info: TraceInfo
    header: Header
    records: list[Record]
    digest: str
    is_truncated: bool

    @property
    def is_ended(self) -> bool:
        """Whether every node of the run has its end record."""
        return {record.node for record in self.records if isinstance(record, EndRecord)} >= set(self.header.nodes)


@no_garbage_collection()
def read_trace(path: Path) -> Trace:
    """Read a trace, up to its last whole record.

    Raises:
        TraceError: the file does not exist, has another version, or is damaged before its last line.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise TraceError(f"The trace {path} cannot be read: {error.strerror}.", fix="name a run folder.") from error
    written = data.partition(_NEVER_WRITTEN)[0]
    lines = written.split(b"\n")
    tail = lines.pop()  # what follows the last newline: nothing, unless the file was cut
    trace_info, header = beginning_of(path, lines[:2])
    try:
        check_scene(header.scene)
    except ValueError as error:
        raise _damaged(f"{path}: the scene in its header is damaged: {error}.") from error
    records: list[Record] = []
    references = References()
    for seq, line in enumerate(lines[2:], start=1):
        try:
            if not line.isascii():
                line.decode()  # msgspec does not check the text of values, which stay encoded
            read = decode_line(line)
            if read.seq != seq:
                raise _damaged(f"{path}: record {seq} has seq {read.seq}; a line was taken out, put in or moved.")
            records.append(references.resolve(read))
        except JSON_ERRORS as error:
            raise _damaged(f"{path}, line {seq + 2} is not a record: {error}. It reads: {line[:100]!r}") from error
        except LookupError as error:
            raise _damaged(f"{path}: {error}.") from error
    _check_values(path, records)
    digest = digest_of(written[len(lines[0]) + 1 : len(written) - len(tail)])
    is_truncated = bool(tail) or len(written) < len(data)
    return Trace(path, trace_info, header, records, digest.hexdigest(), is_truncated)


def beginning_of(path: Path, lines: list[bytes]) -> tuple[TraceInfo, Header]:
    """Return what the first two lines of a trace contain.

    Args:
        path: of the file, for messages.
        lines: the whole ones among the first two.

    Raises:
        TraceError: they are missing, have another version, or are damaged.
    """
    if not lines:
        raise TraceError(f"The trace {path} has no whole line.", fix=_TRUNCATED_TOO_EARLY)
    trace_info = _read_trace_info(path, lines[0])
    if len(lines) == 1:
        raise TraceError(f"The trace {path} has no whole header.", fix=_TRUNCATED_TOO_EARLY)
    return trace_info, _read_beginning(path, lines[1], Header, "its header")


# JSON text never has this byte. After a power loss a file ends with it where blocks were allocated but not written.
_NEVER_WRITTEN = b"\0"
_TRUNCATED_TOO_EARLY = "the run was cut before it began; run it again."


def _damaged(message: str) -> TraceError:
    return TraceError(
        message, fix="the file was changed or damaged after the run; use an untouched copy, or run again."
    )


def _read_trace_info(path: Path, line: bytes) -> TraceInfo:
    try:
        fields = _decode_any(line)
    except JSON_ERRORS:
        fields = None
    # A trace of format 1 began with its header.
    if not isinstance(fields, dict) or fields.get("kind") not in ("trace", "header"):
        raise TraceError(f"{path} is not a trace: its first line does not say so.", fix="name a run folder.")
    if fields.get("schema") != SCHEMA or type(fields["schema"]) is not int:
        raise TraceError(
            f"{path} has trace format {fields.get('schema')!r}; this kit reads format {SCHEMA}.",
            fix="use the kit that wrote it, or run the scenario again.",
        )
    return _read_beginning(path, line, TraceInfo, "its first line")


_Kind = TypeVar("_Kind", TraceInfo, Header)


def _read_beginning(path: Path, line: bytes, kind: type[_Kind], what: str) -> _Kind:
    try:
        read = decode_beginning(line)
    except JSON_ERRORS as error:
        raise _damaged(f"{path}: {what} is damaged: {error}.") from error
    if not isinstance(read, kind):
        raise _damaged(f"{path}: {what} is damaged: it is of another kind.")
    return read


def _check_values(path: Path, records: list[Record]) -> None:
    for record in records:
        if isinstance(record, (ErrorRecord, LogLineRecord)) and record.cause >= record.seq:
            raise _damaged(f"{path}: the cause of record {record.seq} does not come before it.")
        for values in _values_in(record):
            if bytes(values)[:1] != b"[":
                raise _damaged(f"{path}: record {record.seq} has values that are not a list.")


def _values_in(record: Record) -> Sequence[msgspec.Raw]:
    """Return the values of every task that a record contains."""
    if isinstance(record, InputRecord):
        return (record.values,)
    if isinstance(record, Executed):
        return [task.values for by in record.handled for task in by.returned]
    if isinstance(record, BeginRecord):
        return [task.values for task in record.returned]
    return ()
