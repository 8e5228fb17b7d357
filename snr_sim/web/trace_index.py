"""Finds in a trace, also while it grows, the few lines that a page needs, without reading the others.

A trace has some 500 lines for each second of a run, nearly all of them steps in which nothing happens. Searching the
bytes for what such a line must contain takes a hundredth of the time that decoding takes; pages are decoded when they
are asked for. JSON escapes the quotes inside a text, so what is searched for cannot be part of one.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

import msgspec

from snr_sim.prelude.errors import SnrError, TraceError
from snr_sim.prelude.task import DataKey, Page
from snr_sim.prelude.values import JSON_ERRORS, decode_value
from snr_sim.recording.records import BeginRecord, InputRecord, Line, PageLine, ReturnedTask, TaskLine, decode_line

CHUNK_BYTES = 1 << 20  # a search keeps the interpreter lock: less than a millisecond for one of these
MAX_LINE_BYTES = 1 << 26
_TIME = re.compile(rb'"t":([0-9.eE+-]+)')
Hit: TypeAlias = tuple[int, int]  # offset of a line, and index of what it contains


def in_input(kind: str, name: str) -> bytes:
    """Return what the line of an input contains: a task from outside the node."""
    return b'"type":%s,"name":%s,' % (msgspec.json.encode(kind), msgspec.json.encode(name))


def in_returned(kind: str, name: str) -> bytes:
    """Return what a line contains if it has a task that a handler returned."""
    return b"[%s,%s,[" % (msgspec.json.encode(kind), msgspec.json.encode(name))


def tasks_in(line: Line, kind: str, name: str) -> Iterator[ReturnedTask]:
    """Yield the tasks of a type and a name that a line brings or returns, in order."""
    found: list[ReturnedTask] = []
    if isinstance(line, InputRecord):
        found = [ReturnedTask(line.type, line.name, line.values)]
    elif isinstance(line, BeginRecord):
        found = line.returned
    elif isinstance(line, (TaskLine, PageLine)):
        found = [task for by in line.handled for task in by.returned]
    for task in found:
        if task.type == kind and task.name == name:
            yield task


class TraceIndex:
    """The lines of a trace that have pages of certain keys, or anything else that is searched for.

    Args:
        path: of the trace.
        keys: of pages.
        others: what other lines of interest contain; `advance` yields them.

    Raises:
        TraceError: it cannot be read.
    """

    def __init__(self, path: Path, keys: Sequence[DataKey], others: Sequence[bytes]) -> None:
        self.path: Path = path
        self.until_s: float = 0.0  # time of the newest line
        self._others = others
        self._keys = list(keys)
        self._offsets = {key: array("Q") for key in keys}
        self.searched_bytes: int = 0  # up to the begin of a line
        try:
            self._file = open(path, "rb")  # noqa: SIM115 (closed by `close`)
        except OSError as error:
            raise TraceError(f"The trace {path} cannot be read: {error.strerror}.", fix="name a run folder.") from error

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def advance(self) -> Iterator[tuple[int, Line]]:
        """Search one more piece of the file; yield the lines with what is of interest, each with the index of that.

        `searched_bytes` stays the same when there was no more whole line.
        """
        self._file.seek(self.searched_bytes)
        data = self._file.read(CHUNK_BYTES)
        while b"\n" not in data and len(data) < MAX_LINE_BYTES and (more := self._file.read(CHUNK_BYTES)):
            data += more
        data = data[: data.rfind(b"\n") + 1].partition(b"\0")[0]
        data = data[: data.rfind(b"\n") + 1]  # bytes that were never written end the trace, in the middle of a line
        base = self.searched_bytes
        self.searched_bytes += len(data)
        times = _TIME.findall(data, max(0, len(data) - 4096))
        if times:
            self.until_s = max(self.until_s, float(times[-1]))
        for key in self._keys:
            found = {at for what in (in_input("store_page", key), in_returned("store_page", key))
                     for at in _lines_with(data, what)}  # fmt: skip
            self._offsets[key].extend(base + at for at in sorted(found))
        hits = sorted((at, i) for i, what in enumerate(self._others) for at in _lines_with(data, what))
        for at, i in hits:
            try:
                yield i, decode_line(data[at : data.index(b"\n", at)])
            except JSON_ERRORS as error:
                raise _damaged(self.path) from error

    def page_at(self, key: DataKey, t_s: float) -> Page | None:
        """Return the newest page of a key that was stored up to a moment, None without one."""
        offsets = self._offsets.get(key, array("Q"))
        low, high = 0, len(offsets)
        while low < high:
            middle = (low + high) // 2
            if self._first(key, offsets[middle])[0] <= t_s:
                low = middle + 1
            else:
                high = middle
        if low == 0:
            return None
        pages = [page for stored_s, page in self._pages(key, offsets[low - 1]) if stored_s <= t_s]
        return pages[-1]

    def _first(self, key: DataKey, offset: int) -> tuple[float, Page]:
        return self._pages(key, offset)[0]

    def _pages(self, key: DataKey, offset: int) -> list[tuple[float, Page]]:
        """Return the pages of a key in a line, each with the time at which it was stored."""
        self._file.seek(offset)
        try:
            line = decode_line(self._file.readline().rstrip(b"\n"))
            tasks = list(tasks_in(line, "store_page", key))
            pages: list[Page] = [decode_value(bytes(task.values), {"page": Page})[0] for task in tasks]
        except (*JSON_ERRORS, SnrError, IndexError) as error:
            raise _damaged(self.path) from error
        # What a handler returns, it makes at that moment. A page from another node has that node's time.
        if isinstance(line, InputRecord):
            return [(line.t, page) for page in pages]
        return [(page.created_at_s, page) for page in pages]


def _lines_with(data: bytes, what: bytes) -> Iterator[int]:
    """Yield the offset of each line that contains something."""
    at = data.find(what)
    while at >= 0:
        yield data.rfind(b"\n", 0, at) + 1
        end = data.find(b"\n", at)
        at = data.find(what, end)


def _damaged(path: Path) -> TraceError:
    return TraceError(f"The trace {path} is damaged.", fix="snr trace RUN names the line.")
