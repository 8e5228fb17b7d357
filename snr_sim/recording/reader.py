"""Reads a trace back, and says what is wrong with one that cannot be used."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from snr_sim.prelude.errors import TraceError
from snr_sim.recording.records import SCHEMA, EndRecord, Header, Record, decode_header, decode_record, digest_of_header

_decode_any = msgspec.json.Decoder().decode


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
            records.append(decode_record(line))
        except (msgspec.DecodeError, RecursionError) as error:
            raise TraceError(
                f"{path}, line {number} is not a record: {error}. It reads: {line[:100]!r}",
                fix="the file was changed or damaged after the run; use an untouched copy, or run again.",
            ) from error
    _check_order(path, records)
    return Trace(path, header, records, digest.hexdigest(), is_cut=bool(tail))


def _read_header(path: Path, line: bytes) -> Header:

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
        return decode_header(line)
    except (msgspec.DecodeError, RecursionError) as error:
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
