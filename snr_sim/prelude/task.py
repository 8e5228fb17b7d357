"""Tasks, the only messages inside a node, and pages, the data that they carry.

A handler takes a task and returns the next ones. A page is named and stamped; loops and handlers store pages, and the
datastore keeps the newest of each key. Its data are a snapshot: dicts, lists, tuples and numpy arrays of real numbers
are copied, and so are dataclasses, Structs and named tuples; immutable values are not. Other objects are not copied
either, because a copy may not be independent; the caller gets their list. A number costs nothing, a dict of three
0.2 us, an inertial reading (seven values, three of them lists) 1 us, an image of 320 x 240 in three colours 3 us (one
core of an AMD EPYC, Python 3.11).
"""

from __future__ import annotations

import copy
import dataclasses
import sys
from collections.abc import Callable, Mapping, Sequence
from enum import Enum, StrEnum
from functools import lru_cache
from threading import RLock
from typing import Any, TypeAlias, TypeVar

import msgspec

from snr_sim.prelude.errors import TaskError, ValueEncodingError
from snr_sim.prelude.values import (
    JSON_ERRORS,
    LONG_BYTES,
    REAL_DTYPES,
    TAG,
    decode_value,
    encode_value,
    encode_with_tags,
    json_bytes,
    may_have_tags,
    no_garbage_collection,
)

DataKey: TypeAlias = str

_encode = msgspec.json.Encoder().encode

# Immutable values, by exact class: nearly all that pages contain.
IMMUTABLE = frozenset((type(None), bool, int, float, str, bytes))
_are_immutable = IMMUTABLE.issuperset

_MAX_TYPES = 256  # that are remembered, and so kept in memory: reloaded files make new ones
_lock = RLock()  # not a Lock: the garbage collector may run any code meanwhile, even this function

AnyKind = TypeVar("AnyKind")


class TaskType(StrEnum):
    """The five kinds of task. A StrEnum, because its hash is C code and it is its own JSON."""

    event = "event"
    store_page = "store_page"
    store_data = "store_page"  # an alias, also used by the thesis' text
    process_data = "process_data"
    reload = "reload"
    terminate = "terminate"


TaskName: TypeAlias = str
# What a handler is registered for: every task of a type, or only those with one name.
TaskId: TypeAlias = TaskType | tuple[TaskType, TaskName]


_STORE_PAGE = TaskType.store_page  # looked up once: in Python 3.11 a member of an Enum takes 0.1 us to find


class Task(msgspec.Struct, frozen=True):
    """One piece of work for a node's handlers.

    A frozen msgspec Struct: the event machine makes these by the million, and a frozen dataclass costs four
    times as much to make.

    Args:
        type: one of the five kinds.
        name: subject: an event's name, a page's key, a component's name, a reason to terminate.
        val_list: values; each task has a list of its own.

    >>> Task(TaskType.event, "start").id()
    (<TaskType.event: 'event'>, 'start')
    """

    type: TaskType
    name: TaskName
    val_list: list[Any] = []

    @property
    def page(self) -> Page | None:
        """The page in a `store_page` or `process_data` task; None if there is none."""
        values = self.val_list
        return values[0] if values and type(values[0]) is Page else None

    def id(self) -> tuple[TaskType, TaskName]:
        """Return the type and name that handlers register for to get exactly this task."""
        return (self.type, self.name)

    def __hash__(self) -> int:
        return hash((self.type, self.name))

    @staticmethod
    def store_page(page: Page) -> Task:
        """Return the task that stores a page."""
        return Task(_STORE_PAGE, page.key, [page])

    def serialize(self) -> bytes:
        """Return the task as one line of JSON, exactly: float64, NaN and arrays survive."""
        return encode_value([self.type.value, self.name, self.val_list])

    @staticmethod
    def deserialize(data: bytes) -> Task:
        """Return the task that `serialize` wrote.

        Raises:
            TaskError: the bytes are not a task.
        """
        try:
            kind, name, val_list = decode_value(data, KINDS)
            if not (isinstance(name, str) and isinstance(val_list, list)):
                raise TypeError("a name is text, and values are in a list")
            return Task(TaskType(kind), name, val_list)
        except (ValueEncodingError, ValueError, TypeError) as error:
            raise TaskError(
                f"These bytes are not a task: {data!r:.80}", fix="they are [type, name, values] in JSON."
            ) from error


# What a handler may return: nothing, a task, or several, handled in that order.
SomeTasks: TypeAlias = Task | Sequence[Task] | None
TaskHandler: TypeAlias = Callable[[Task, TaskId], SomeTasks]
TaskHandlerMap: TypeAlias = dict[TaskId, TaskHandler]


class Page(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="page"):
    """Data with a name, origin and time.

    Args:
        key: the page's name in the datastore.
        data: plain JSON types and numpy arrays survive recording and links exactly. A component's `page` and
            `store_data` copy them, so that a page does not change with its owner's list; a page that is made
            directly does not copy its data.
        origin: name of the node that made it.
        created_at_s: node time when it was made.
        process: whether a `process_data` task follows once it is stored.
    """

    key: DataKey
    data: Any
    origin: str
    created_at_s: float
    process: bool = True

    def serialize(self) -> bytes:
        """Return the page as one line of JSON that decodes to equal data: see `prelude/values.py`.

        >>> Page("depth", 1.5, "urov_node", 0.25).serialize()
        b'{"$":"page","key":"depth","data":1.5,"origin":"urov_node","created_at_s":0.25,"process":true}'
        """
        try:
            raw = _encode(self)
            # Values that C cannot encode (NaN, a tuple, ...) decode to unequal ones. Usually the page's "$" is the only
            # one in the text; else its mark must be the only mark.
            if raw.rfind(b"$") == 2 or raw.count(b'"$":') == 1:
                decode = _decode_data if len(raw) < LONG_BYTES else _decode_long_data
                if decode(raw).data == self.data:
                    return raw
        except (TypeError, ValueError, OverflowError, RecursionError):
            pass  # numpy, an unknown object, nested too deeply
        return encode_with_tags(self)

    @staticmethod
    def deserialize(raw: bytes | str, kinds: Mapping[str, Callable[..., Any]] | None = None) -> Page:
        """Return the page that `serialize` wrote; `kinds` as of `decode_value`, by default those of tasks and traces.

        Raises:
            ValueEncodingError: the JSON is not a page.
        """
        data = json_bytes(raw)
        try:
            # In our own format, and without further marks: then C decodes all of it.
            is_plain = data.startswith(_OWN_TAG) and not may_have_tags(data, len(_OWN_TAG))
            page: Any = _decode_page(data) if is_plain else decode_value(data, kinds or KINDS)
        except JSON_ERRORS as error:
            raise ValueEncodingError(f"This is not a page ({error}): {data[:80]!r}", fix=_FIX) from error
        if not isinstance(page, Page):
            raise ValueEncodingError(f"This is not a page: {data[:80]!r}", fix=_FIX)
        return page


_OWN_TAG = b'{"$":"page"'
_FIX = "pages are written by Page.serialize(); PageReader also reads those of the 2021 library."


class _DataOfPage(msgspec.Struct):
    """A page's data alone: decoding the other fields, only to drop them, would take as long again."""

    data: Any


_decode_page = msgspec.json.Decoder(Page).decode
_decode_data = msgspec.json.Decoder(_DataOfPage).decode
_decode_long_data = no_garbage_collection()(_decode_data)


def _page_of(**fields: Any) -> Page:
    return msgspec.convert(fields, ensure_type_info(Page))


# The marks of tasks and traces in addition to the plain ones of prelude/values.py.
KINDS = {"page": _page_of}


def snapshot(value: Any, objects: list[Any]) -> Any:
    """Return a copy of the data: later changes of the value do not affect it.

    The objects in it that are not data are not copied, and are appended to `objects`.

    Raises:
        RecursionError: it contains itself, or is nested too deeply.

    >>> data = {"position_m": [1.0, 2.0]}
    >>> kept = snapshot(data, [])
    >>> data["position_m"].append(3.0)
    >>> kept
    {'position_m': [1.0, 2.0]}
    """
    kind = type(value)
    if kind in IMMUTABLE:
        return value
    if kind is dict:
        kept = value.copy()
        if not _are_immutable(map(type, kept.values())):  # in C: half the time of a check of each
            for key, item in value.items():
                if type(item) not in IMMUTABLE:
                    kept[key] = snapshot(item, objects)
        return kept
    if kind is list:
        return value.copy() if _are_immutable(map(type, value)) else [snapshot(item, objects) for item in value]
    if kind is tuple:
        return tuple([snapshot(item, objects) for item in value])
    return _snapshot_of_other(value, objects)


def _snapshot_of_other(value: Any, objects: list[Any]) -> Any:
    kind = type(value)  # not isinstance: that calls the object, which may raise
    numpy = sys.modules.get("numpy")
    if numpy is not None and issubclass(kind, (numpy.ndarray, numpy.generic)) and value.dtype.char in REAL_DTYPES:
        return value.copy() if issubclass(kind, numpy.ndarray) else value
    if issubclass(kind, (int, float, str, bytes, Enum)):
        return value
    if issubclass(kind, (dict, list, bytearray)):  # also for subclasses, which become the plain type
        return _snapshot_of_container(value, objects)
    if issubclass(kind, tuple) and hasattr(kind, "_make"):
        return kind._make([snapshot(item, objects) for item in value])
    if issubclass(kind, msgspec.Struct):
        return _with_fields(value, value.__struct_fields__, msgspec.structs.force_setattr, objects)
    if dataclasses.is_dataclass(kind):
        return _with_fields(value, [one.name for one in dataclasses.fields(value)], object.__setattr__, objects)
    objects.append(value)
    return value


def _snapshot_of_container(value: Any, objects: list[Any]) -> Any:
    kept = copy.copy(value)
    if isinstance(kept, (dict, list)):
        for key, item in list(kept.items() if isinstance(kept, dict) else enumerate(kept)):
            kept[key] = snapshot(item, objects)
    return kept


def _with_fields(record: Any, names: Any, set_field: Callable[[Any, str, Any], None], objects: list[Any]) -> Any:
    kept = copy.copy(record)
    for name in names:
        set_field(kept, name, snapshot(getattr(record, name), objects))
    return kept


def ensure_type_info(kind: AnyKind) -> AnyKind:
    """Make msgspec's information of a type and all types inside complete, and return the type: then it is thread-safe.

    At first use msgspec fills it step by step, and a second thread may read it half filled: msgspec 0.22 then crashes
    with a segmentation fault, for dataclasses, too. Later uses are safe. So a module makes its decoders once,
    at import, and code that gets a type as an argument calls `msgspec.convert(data, ensure_type_info(kind))`.

    Raises:
        TypeError: msgspec does not support the type.
    """
    _build_decoder(kind)
    return kind


@lru_cache(_MAX_TYPES)
def _build_decoder(kind: Any) -> None:
    with _lock:
        msgspec.json.Decoder(kind)
