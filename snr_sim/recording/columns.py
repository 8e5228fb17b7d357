"""Records of a run, converted from rows to columns, which the viewer and the picture draw.

A trace is a list of records; a plot needs one array per number. Converting 20 000 rows is fast if it is done a column
at a time and slow a row at a time, so no code here processes single numbers.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from operator import attrgetter, itemgetter
from typing import Any, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from snr_sim.prelude.errors import ValueEncodingError
from snr_sim.prelude.task import KINDS, Page
from snr_sim.prelude.values import JSON_ERRORS, decode_value
from snr_sim.recording.records import (
    BeginRecord,
    EndRecord,
    ErrorRecord,
    Executed,
    InputRecord,
    LogLineRecord,
    PageRecord,
    Record,
    ReturnedTask,
    TruthRecord,
)

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
_Event: TypeAlias = BeginRecord | EndRecord | ErrorRecord | LogLineRecord

# A longer list in a page is an image or a scan: as lines in a plot it would not be readable.
MAX_LIST_PLOTTED = 32
# An input is executed soon after it came in; of one that waited for longer than so many others, only the seq is known.
MAX_PENDING_INPUTS = 10_000

# A true number of such a name is 1 from when on what makes the arrow of that name is broken.
BROKEN = "broken_"

_IMAGE_MARK = b'"dtype":"uint8"'
_TRANSITION = ".transition"  # end of the names of events by which state machines report a change
_NUMBERS = {float, int, bool}
_NO_ARROW = [0.0] * 6


class _PlainPage(msgspec.Struct, gc=False):
    """The part of a page that is used: its data, and the node that created it; the decoder skips the rest."""

    data: Any
    origin: str = ""


_decode_pages = msgspec.json.Decoder(list[tuple[_PlainPage]]).decode


@dataclass(frozen=True)
class When:
    """Order and time of rows: `seq` is their order, `t_s` virtual time."""

    seq: Ints
    t_s: Floats

    def __getitem__(self, rows: Any) -> When:
        return When(self.seq[rows], self.t_s[rows])

    def __len__(self) -> int:
        return len(self.seq)

    @staticmethod
    def of(records: Sequence[Record | Executed]) -> When:
        """Return order and time of records."""
        return When(np.array([record.seq for record in records], np.int64), np.array([record.t for record in records]))


@dataclass(frozen=True)
class Series:
    """One number over a run: its path, such as ('inertial', 'velocity_mps', '0'), and its values."""

    path: tuple[str, ...]
    when: When
    values: Floats
    is_flag: bool = False  # yes or no


@dataclass(frozen=True)
class LogRows:
    """Lines of text with their level: INFO for inputs, DEBUG for tasks that follow from them, ERROR for failures."""

    when: When
    texts: list[str]
    levels: list[str]


class Batch:
    """Some records of a run in their order, sorted by the kind of their display.

    Example:
        >>> batch = Batch()
        >>> batch.extend([TruthRecord(seq=1, t=0.0, poses={}, vectors={}, values={"altitude_m": 4.5})])
        >>> [(series.path, series.values.tolist()) for series in batch.truth_values()]
        [(('altitude_m',), [4.5])]
    """

    def __init__(self) -> None:
        self._sources: dict[int, str] = {}
        self._arrow_names: dict[str, None] = {}
        self.clear()

    def extend(self, records: Iterable[Record]) -> None:
        """Add records. One loop that calls nothing of ours: such a call would cost as much as all the rest."""
        pages, executed = self._pages, self._executed
        for record in records:
            if isinstance(record, Executed):
                executed[record.node].append(record)
                if isinstance(record, PageRecord):
                    pages[record.node, record.name].append(record)
            elif isinstance(record, InputRecord):
                self._sources[record.seq] = record.source
            elif isinstance(record, TruthRecord):
                self.truths.append(record)
            elif isinstance(record, _Event):
                self._events[record.node].append(record)

    def clear(self) -> None:
        """Drop the records, but keep the inputs that are not executed yet."""
        self.truths: list[TruthRecord] = []
        self._pages: dict[tuple[str, str], list[PageRecord]] = defaultdict(list)
        self._executed: dict[str, list[Executed]] = defaultdict(list)
        self._events: dict[str, list[_Event]] = defaultdict(list)
        for seq in list(self._sources)[:-MAX_PENDING_INPUTS]:
            del self._sources[seq]

    def truth_values(self) -> Iterator[Series]:
        """Return every number of the plant's true state."""
        yield from _columns((), When.of(self.truths), [truth.values for truth in self.truths])

    def poses(self) -> Iterator[tuple[str, When, Floats]]:
        """Return the pose of each body: name, when, array of shape (n, 7)."""
        for body, when, poses in _by_name(When.of(self.truths), [truth.poses for truth in self.truths]):
            flat = _floats(list(chain.from_iterable(poses)))
            if len(flat) == 7 * len(poses):
                yield body, when, flat.reshape(-1, 7)

    def vectors(self) -> Iterator[tuple[str, When, Floats]]:
        """Return each arrow: name, when, array of shape (n, 6). Its length is 0 where a true state does not have it."""
        when, rows = When.of(self.truths), [truth.vectors for truth in self.truths]
        self._arrow_names |= dict.fromkeys(chain.from_iterable(rows))
        for name in self._arrow_names if rows else ():
            flat = _floats(list(chain.from_iterable([row.get(name, _NO_ARROW) for row in rows])))
            if len(flat) != 6 * len(rows):
                continue
            vectors = flat.reshape(-1, 6)
            pushes: NDArray[np.bool_] = np.any(vectors[:, 3:] != 0.0, axis=1)
            # Only where it is visible or has just vanished: a jet that fires rarely needs almost no data.
            is_sent = pushes | np.concatenate((np.array([True]), pushes[:-1]))
            yield name, when[is_sent], vectors[is_sent]

    def pages(self) -> Iterator[tuple[str, list[PageRecord]]]:
        """Return the pages that were stored at each node, in order."""
        for node, records in self._executed.items():
            if pages := [record for record in records if isinstance(record, PageRecord)]:
                yield node, pages

    def stored_by(self, page: PageRecord) -> str:
        """Return what stored a page, for example 'autopilot.steer in process_data depth', or its source."""
        if source := self._sources.get(page.cause):
            return source
        made = _record_at(page.cause, self._executed[page.node]) or _record_at(
            page.cause, self._events.get(page.node, ())
        )
        if isinstance(made, BeginRecord):
            return f"{made.component}.begin"
        place = page.index
        for part in made.handled if isinstance(made, Executed) else ():
            if place < len(part.returned):
                return f"{part.component}.{part.handler} in {made.type} {made.name}"
            place -= len(part.returned)
        return "an earlier task"

    def page_values(self) -> Iterator[tuple[str, Series]]:
        """Return every number that pages carried: node and series, whose path begins with the page's key."""
        for (node, key), records in self._pages.items():
            data = page_data([record.values for record in records])
            for series in _columns((key,), When.of(records), data):
                yield node, series

    def images(self) -> Iterator[tuple[str, tuple[str, ...], When, list[NDArray[np.uint8]]]]:
        """Return camera images: node, path of the field, when, and images of shape (height, width, 3)."""
        for (node, key), records in self._pages.items():
            if _IMAGE_MARK not in bytes(records[0].values):
                continue
            data = page_data([record.values for record in records])
            for field in data[0] if isinstance(data[0], dict) else ():
                seen = [
                    (record, one[field])
                    for record, one in zip(records, data, strict=True)
                    if isinstance(one, dict) and _is_image(one.get(field))
                ]
                if seen:
                    yield node, (key, field), When.of([record for record, _ in seen]), [image for _, image in seen]

    def page_texts(self, field: str) -> Iterator[tuple[list[float], list[str]]]:
        """Return the texts in a field of each key's pages, at the node that created them: times [s], texts."""
        for (node, key), records in self._pages.items():
            if self.is_copy(node, key):
                continue
            data = page_data([record.values for record in records])
            found = [
                (record.t, one[field])
                for record, one in zip(records, data, strict=True)
                if isinstance(one, dict) and isinstance(one.get(field), str)
            ]
            if found:
                yield [time_s for time_s, _ in found], [text for _, text in found]

    def changes_of_state(self) -> Iterator[tuple[str, str, When, list[str]]]:
        """Return for each state machine its node, its path, when it changed its state, and the states."""
        for node, records in self._executed.items():
            found: dict[str, tuple[list[Executed], list[str]]] = {}
            for record in records:
                if record.type == "event" and record.name.endswith(_TRANSITION):
                    change = _first_value(record)
                    if isinstance(change, dict) and {"machine", "target"} <= change.keys():
                        at, states = found.setdefault(str(change["machine"]), ([], []))
                        at.append(record)
                        states.append(str(change["target"]))
            for machine, (at, states) in found.items():
                yield node, machine, When.of(at), states

    def is_copy(self, node: str, key: str) -> bool:
        """Return whether another node created the first page of a key at a node: it came over a link."""
        try:
            ((page,),) = _decode_pages(b"[" + bytes(self._pages[node, key][0].values) + b"]")
        except JSON_ERRORS:
            return False
        return page.origin not in ("", node)

    def executed(self) -> Iterator[tuple[str, LogRows]]:
        """Return for each node one line of text per executed task."""
        for node, records in self._executed.items():
            sources = [self._sources.get(record.cause) for record in records]
            levels = ["INFO" if source else "DEBUG" for source in sources]
            lines = [_line(record, source) for record, source in zip(records, sources, strict=True)]
            yield node, LogRows(When.of(records), lines, levels)

    def events(self) -> Iterator[tuple[str, LogRows]]:
        """Return for each node its start, its end, and its failures."""
        for node, records in self._events.items():
            texts, levels = zip(*map(_event, records), strict=True)
            yield node, LogRows(When.of(records), list(texts), list(levels))


def _record_at(seq: int, records: Sequence[Any]) -> Any:
    """Return the record with this seq; None if it is not among the records."""
    at = bisect_left(records, seq, key=attrgetter("seq"))
    return records[at] if at < len(records) and records[at].seq == seq else None


def _is_image(value: Any) -> bool:
    is_array = isinstance(value, np.ndarray) and value.dtype == np.uint8
    return is_array and value.ndim == 3 and value.shape[2] == 3 and value.size > 0


def _line(record: Executed, source: str | None) -> str:
    """Return for example '147  process_data  inertial       <- 146                  pad: store_page engine'."""
    made = "; ".join([f"{part.component}: {_tasks(part.returned)}" for part in record.handled if part.returned])
    return f"{record.seq}  {_padded(record.type, record.name)} <- {record.cause or 'begin'}{_origin(source)}{made}"


# The texts are few and repeat often, so each phrase and its padding is built once.
@lru_cache(4096)
def _padded(kind: str, name: str) -> str:
    return f"{kind:<13} {name:<14}"


@lru_cache(4096)
def _origin(source: str | None) -> str:
    return f" {source or '':<16} "


def _tasks(returned: Sequence[ReturnedTask]) -> str:
    return ", ".join([f"{task.type} {task.name}" for task in returned])


def _event(record: _Event) -> tuple[str, str]:
    if isinstance(record, LogLineRecord):
        return f"{record.component}: {record.text}", "INFO" if record.level == "PRINT" else record.level
    if isinstance(record, ErrorRecord):
        return f"{record.component}: {record.message}", "ERROR"
    if isinstance(record, BeginRecord):
        return f"{record.component} begins: {_tasks(record.returned) or 'nothing to do'}", "INFO"
    return f"{record.node} ends: {record.reason}", "INFO"


def _first_value(record: Executed) -> Any:
    """Return the first value of a task, or None."""
    try:
        values = decode_value(bytes(record.values), KINDS)
    except ValueEncodingError:
        return None
    return values[0] if isinstance(values, list) and values else None


def page_data(raws: Sequence[msgspec.Raw]) -> list[Any]:
    """Return the `data` of each page; None where it cannot be decoded.

    Args:
        raws: the values of `store_page` tasks, [page] as JSON.
    """
    joined = b"[" + b",".join(raws) + b"]"
    # Each page has one mark "$", its own. No more of them: all data is plain JSON, and C can decode it in one go.
    if joined.count(b'"$":') == len(raws):
        try:
            return [page.data for (page,) in _decode_pages(joined)]
        except JSON_ERRORS:
            pass  # an edited trace: decode the pages one by one, so that the valid ones are still shown
    return [_one_page_data(bytes(raw)) for raw in raws]


def _one_page_data(raw: bytes) -> Any:
    try:
        values = decode_value(raw, KINDS)
    except ValueEncodingError:
        return None
    page = values[0] if isinstance(values, list) and values else None
    return page.data if isinstance(page, Page) else None


def _columns(path: tuple[str, ...], when: When, rows: Sequence[Any]) -> Iterator[Series]:
    """Return the numbers in `rows` at any nesting depth, as one series per path."""
    kinds = set(map(type, rows))
    if not kinds:
        return
    if kinds <= _NUMBERS:
        yield Series(path, when, _floats(rows), kinds == {bool})
    elif kinds == {dict} or kinds == {list}:
        for name, some, inner in _by_name(when, rows) if kinds == {dict} else _by_index(when, rows):
            yield from _columns((*path, str(name)), some, inner)
    else:
        yield from _mixed(path, when, rows)


def _by_name(when: When, rows: Sequence[Any]) -> Iterator[tuple[Any, When, Sequence[Any]]]:
    """Return for each key of rows of dicts: order and time of the rows that have it, and their values."""
    names = list(rows[0]) if rows else []
    if len(names) > 1 and sum(map(len, rows)) == len(rows) * len(names):
        try:
            columns = list(zip(*map(itemgetter(*names), rows), strict=True))
        except KeyError:
            pass  # the same number of keys, but other ones
        else:
            yield from ((name, when, column) for name, column in zip(names, columns, strict=True))
            return
    for name in dict.fromkeys(chain.from_iterable(rows)):
        picked = [i for i, row in enumerate(rows) if name in row]
        yield name, when[picked], [rows[i][name] for i in picked]


def _by_index(when: When, rows: Sequence[Any]) -> Iterator[tuple[int, When, Sequence[Any]]]:
    """Return for each index of rows of lists: order and time of the rows that have it, and their values."""
    lengths = set(map(len, rows))
    if max(lengths) > MAX_LIST_PLOTTED:
        return
    if len(lengths) == 1:
        yield from ((i, when, column) for i, column in enumerate(zip(*rows, strict=True)))
        return
    for at in range(max(lengths)):
        picked = [i for i, row in enumerate(rows) if len(row) > at]
        yield at, when[picked], [rows[i][at] for i in picked]


def _mixed(path: tuple[str, ...], when: When, rows: Sequence[Any]) -> Iterator[Series]:
    """Split rows by kind of value; text, None and other non-numbers are dropped."""
    plain = [_plain(row) for row in rows]
    for kinds in (_NUMBERS, {dict}, {list}):
        picked = [i for i, row in enumerate(plain) if type(row) in kinds]
        if picked:
            yield from _columns(path, when[picked], [plain[i] for i in picked])


def _plain(value: Any) -> Any:
    """Return arrays and tuples as lists; other values unchanged."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist() if value.size <= MAX_LIST_PLOTTED else None
    return list(value) if isinstance(value, tuple) else value


def _floats(values: Sequence[Any]) -> Floats:
    try:
        return np.array(values, np.float64)
    except OverflowError:  # an int too large for a float
        return np.array([_float(value) for value in values])


def _float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")
