"""Readers of the lines of a text file, and of the pages of a recording or a trace. They work without a node.

A recording is written by `recording/page_recorder.py`: a page on each line, and before the pages of each run a line
`{"$":"start","node":"urov_node"}`. A trace is the `trace.jsonl` of any recorded run. Recordings of the 2021 library
are supported, too: their pages are plain JSON objects, which may contain NaN.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Generic, NamedTuple, Self, TypeVar

import msgspec

from snr_sim.prelude.errors import RecordingError, ValueEncodingError
from snr_sim.prelude.task import DataKey, Page, ensure_type_info
from snr_sim.prelude.values import JSON_ERRORS, TAG
from snr_sim.recording.records import PageRecord, decode_line
from snr_sim.recording.references import References

START = "start"
_START_LINE = f'{{"{TAG}":"{START}"'.encode()
_PAGE_OF_2021 = b'{"key":'
MAX_WARNINGS = 3  # for a file that is not a recording at all, one remark per line would be useless


T = TypeVar("T")


class _Reader(Generic[T]):
    """A file that is closed when all of it has been read, or at the end of a `with`."""

    def __init__(self, file: str | Path) -> None:
        self._file = _opened(file)

    def read(self) -> T | None:
        """Return the next item, or None at the end of the file."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the file, which also happens at its end. Safe to call twice."""
        self._file.close()

    def __iter__(self) -> Iterator[T]:
        return iter(self.read, None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *about: object) -> None:
        self.close()


class TextReader(_Reader[str]):
    """Reader of the lines of a text file, without line ends.

    Args:
        file: path of the file. Bytes that are not valid UTF-8 are read as U+FFFD.
        retired: the 2021 library took a context and a name before the file. Both are rejected.

    Raises:
        RecordingError: the file cannot be read.
    """

    def __init__(self, file: str | Path, *retired: object) -> None:
        super().__init__(file)

    def read(self) -> str | None:
        """Return the next line, or None after the last one."""
        line = b"" if self._file.closed else self._file.readline()
        if line:
            return line.decode(errors="replace").rstrip("\r\n")
        self.close()
        return None


class StoredPage(NamedTuple):
    """A page with the time at which it was stored, on the clock of the node that stored it [s]."""

    time_s: float
    page: Page


class PageReader(_Reader[Page]):
    """Reader of the pages of a recording or a trace, in the order in which they were stored.

    A line that is not a valid page (truncated by a crash, or edited) is skipped with a remark.

    Args:
        file: path of the file.
        keys: of the pages to read; all by default.
        node: whose pages to read from a trace of several nodes, in which a page that crossed a link occurs twice; all
            by default.

    Raises:
        RecordingError: the file cannot be read.
    """

    def __init__(self, file: str | Path, keys: Sequence[DataKey] | DataKey | None = None, node: str = "") -> None:
        super().__init__(file)
        self.path: Path = Path(file)
        self._keys = {keys} if isinstance(keys, str) else None if keys is None else set(keys)
        self._node = node
        self._times = _Times()
        self._references = References()  # between the lines of a trace
        self._number = 0
        self._skipped = 0
        self._warnings: list[str] = []

    @property
    def warnings(self) -> list[str]:
        """Reasons for the lines skipped so far."""
        more = self._skipped - len(self._warnings)
        return [*self._warnings, *([f"... and {more} more lines of {self.path}."] if more else [])]

    def read(self) -> Page | None:
        """Return the next page, or None after the last one."""
        stored = self.read_stored()
        return None if stored is None else stored.page

    def read_stored(self) -> StoredPage | None:
        """Return the next page with the time at which it was stored, or None after the last one.

        The time never decreases: pages of a second start follow those of the first.
        """
        for line in () if self._file.closed else self._file:
            self._number += 1
            if line.isspace():
                self._skip(_EMPTY)
                continue
            try:
                stored = self._stored(line)
            except (ValueEncodingError, LookupError, *JSON_ERRORS) as error:
                self._skip(error)
                continue
            if stored is not None and (self._keys is None or stored.page.key in self._keys):
                return stored
        self.close()
        return None

    def _stored(self, line: bytes) -> StoredPage | None:
        if line.startswith(b'{"kind":'):
            return self._of_trace(line)
        if line.startswith(_START_LINE):
            self._times.start(_decode_start(line).node)
            return None
        page = _page_of_2021(line) if line.startswith(_PAGE_OF_2021) else Page.deserialize(line)
        return StoredPage(self._times.of(page), page)

    def _of_trace(self, line: bytes) -> StoredPage | None:
        if not line.startswith(_KINDS_WITH_TASKS):
            return None
        record = self._references.resolve(decode_line(line))
        if not isinstance(record, PageRecord) or self._node not in ("", record.node):
            return None
        return StoredPage(record.t, Page.deserialize(bytes(_decode_values(record.values)[0])))

    def _skip(self, error: Exception) -> None:
        self._skipped += 1
        if len(self._warnings) < MAX_WARNINGS:
            reason = error.message if isinstance(error, ValueEncodingError) else f"This is not a page ({error})."
            self._warnings.append(f"{self.path}, line {self._number} was left out: {reason}")


_EMPTY = ValueEncodingError("It is empty.")


class _Start(msgspec.Struct):
    """The line before the pages of a run."""

    node: str


_KINDS_WITH_TASKS = tuple(f'{{"kind":"{kind}"'.encode() for kind in ("begin", "input", "repeat", "task", "page"))
_decode_start = msgspec.json.Decoder(_Start).decode
_decode_values = msgspec.json.Decoder(list[msgspec.Raw]).decode


class _Times:
    """Times at which the pages of a recording were stored, computed from when they were created.

    Each node counts time from its own start. A page from another node does not contain its time of arrival: the first
    page of each node is assumed to arrive with the page before it, and later ones keep their distance from it.
    """

    def __init__(self) -> None:
        self._now_s = 0.0
        self._start_s = 0.0  # of the run whose pages are read
        self._node = ""
        self._begins_s: dict[str, float] = {}  # of other nodes

    def start(self, node: str) -> None:
        """Start a run at the end of the previous one."""
        self._start_s, self._node, self._begins_s = self._now_s, node, {}

    def of(self, page: Page) -> float:
        """Return when a page was stored; never before the previous page."""
        if not math.isfinite(page.created_at_s):
            return self._now_s
        begins_s = self._start_s
        if self._node and page.origin != self._node:
            begins_s = self._begins_s.setdefault(page.origin, self._now_s - page.created_at_s)
        self._now_s = max(self._now_s, begins_s + page.created_at_s)
        return self._now_s


def _page_of_2021(line: bytes) -> Page:
    """Return a page of the 2021 library: plain JSON of the same fields, in which data are never marks."""
    try:
        return msgspec.convert(json.loads(line), ensure_type_info(Page))  # Python's json accepts NaN and Infinity
    except (ValueError, msgspec.ValidationError) as error:
        raise ValueEncodingError(f"This is not a page of the 2021 library ({error}): {line[:80]!r}") from error


def _opened(file: str | Path) -> BinaryIO:
    if not isinstance(file, (str, Path)):
        raise RecordingError(
            f"A reader got {file!r:.80} where its file belongs.", fix="the file first, such as TextReader('moves.txt')."
        )
    try:
        return Path(file).open("rb")
    except OSError as error:
        raise RecordingError(
            f"The file {file} cannot be read: {error.strerror}.", fix="a file that is there."
        ) from error
