"""The lines of `trace.jsonl` and the records that they encode. Each is one JSON object with a `kind`.

A line does not repeat the content of earlier ones: an executed task is identified by `cause` and `index`, the record
that contains it and its index among that record's tasks, which has the type, name and values. `references.py` builds
whole records from lines; only the reader of a trace and a live view process lines.

`truth` is a record and not a page because the view must be derivable from the trace alone, and a student's controller
must not be able to read it. `page` is a kind of its own so that `snr trace --kind page` prints pages; executed tasks
are `task` and `page` together. An object of a class that JSON, numpy and pages do not know is written readably and
cannot be restored: a trace whose inputs hold one cannot be replayed.

`seq` is the order over all nodes of the run; `t` is virtual time and does not define the order. `values` is the list
that a task carries, as written by `prelude/values.py`; it is left encoded here because most readers need only part of
it. docs/formats.md describes the same for readers of traces without snr_sim, and the shipped schema is generated from
these classes: a field added here requires a new `SCHEMA`.
"""

from __future__ import annotations

import hashlib
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias

import msgspec

SCHEMA: Final = 3
MAX_LOG_LINE_CHARS = 2_000  # of a line that was printed or logged
MAX_LOG_LINES = 10_000  # of a node

Count: TypeAlias = Annotated[int, msgspec.Meta(ge=0)]
Seq: TypeAlias = Annotated[int, msgspec.Meta(ge=1)]
Values: TypeAlias = Annotated[
    msgspec.Raw, msgspec.Meta(extra_json_schema={"type": "array", "items": {"$ref": "value.schema.json"}})
]


class _Line(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind"):
    """A line of the file."""


class _OfNode(_Line, frozen=True):
    """Common fields of most records of a node."""

    seq: Seq
    t: float
    node: str


class TraceInfo(_Line, frozen=True, tag="trace"):
    """The first line: identifies a trace, and how and when it was made. The digest begins after it.

    Args:
        schema: version of this format; a reader refuses others.
        scenario, controller: as requested: a name, or the path of a file; "" if not given.
        started: local time, ISO 8601 with the offset to UTC.
        argv: the command line.
        hash_seed: value of PYTHONHASHSEED, which determines the order of sets of texts; 'random' if it was not set.
    """

    schema: Annotated[int, msgspec.Meta(ge=SCHEMA, le=SCHEMA)]
    scenario: str
    controller: str
    started: str
    argv: list[str]
    hash_seed: str

    @staticmethod
    def now(scenario: str, controller: str) -> TraceInfo:
        """Return the first line of a trace that begins now, in this process."""
        return TraceInfo(
            SCHEMA, scenario, controller, time.strftime("%Y-%m-%dT%H:%M:%S%z"), list(sys.argv), hash_seed()
        )


def hash_seed() -> str:
    """Return the hash seed, which determines the order of sets in this process: a number, or 'random'."""
    return os.environ.get("PYTHONHASHSEED") or "random"


class Header(_Line, frozen=True, tag="header"):
    """The second line: what ran, with which versions, seeds and sources.

    Args:
        kit, python, platform, packages: versions of what computed the run.
        scenario, robot, controller: their names, without folder and suffix; "" if not given.
        roles, engine, io, seed, options: as requested.
        nodes: name of the node of each role, in the order they run.
        clock: 'sim' (stepped) or 'wall' (threads).
        commands: keys of pages that drive actuators, per node.
        sources: sha256 of every source file of robot, controller and scenario, by path relative to its folder; and of a
            file that an option names, by `option/` and the option's key.
        scene: shapes of the plant, see `Plant.scene`.
    """

    version: str
    python: str
    platform: str
    packages: dict[str, str]
    scenario: str
    robot: str
    controller: str
    roles: list[str]
    engine: str
    io: str
    seed: int
    options: dict[str, str]
    nodes: list[str]
    clock: str
    commands: dict[str, list[str]]
    sources: dict[str, str]
    scene: dict[str, Any]


class ReturnedTask(msgspec.Struct, frozen=True, forbid_unknown_fields=True, array_like=True):
    """A task that a handler returned: [type, name, values]."""

    type: str
    name: str
    values: Values


class HandlerCall(msgspec.Struct, frozen=True, forbid_unknown_fields=True, array_like=True):
    """One handler's part in a task: [component, handler, tasks]."""

    component: str
    handler: str
    returned: list[ReturnedTask]


class InputRecord(_OfNode, frozen=True, tag="input"):
    """A task from outside the node: from the loop, link or person named in `source`."""

    source: str
    type: str
    name: str
    values: Values


class RepeatLine(_OfNode, frozen=True, tag="repeat"):
    """An input that is already in this trace, such as a page that a link brings to another node of the same run.

    Args:
        cause, nth: the task that it repeats, identified as an executed one.
    """

    source: str
    cause: Seq
    index: Count


class TaskLine(_Line, frozen=True, omit_defaults=True, tag="task"):
    """A task that was executed, on the node of its cause; see `TaskRecord`.

    Args:
        t: only if it differs from that of the cause.
    """

    seq: Seq
    cause: Seq
    index: Count = 0
    t: float | msgspec.UnsetType = msgspec.UNSET
    handled: list[HandlerCall] = []


class PageLine(_Line, frozen=True, omit_defaults=True, tag="page"):
    """A `store_page` task that was executed; see `TaskLine`.

    Args:
        process: what the node itself did before everything in `handled`: it stored the page and scheduled
            `process_data` (true), or only stored it (false). Null: neither, or in another order; `handled` is complete.
    """

    seq: Seq
    cause: Seq
    index: Count = 0
    t: float | msgspec.UnsetType = msgspec.UNSET
    process: bool | None = True
    handled: list[HandlerCall] = []


class Executed(_OfNode, frozen=True):
    """A task that was executed: a `TaskRecord` or a `PageRecord`."""

    type: str
    name: str
    values: Values
    cause: Seq
    index: Count
    handled: list[HandlerCall]


class TaskRecord(Executed, frozen=True, tag="task"):
    """A task that was executed, and what its handlers returned.

    Args:
        cause: seq of the record that contains it: an input, a task, a page, a component's `begin`.
        nth: its index among all tasks of that record, over all its handlers; the first is 0.
        handled: one entry per handler, in order; a handler that raised is not among them.
    """


class PageRecord(Executed, frozen=True, tag="page"):
    """A `store_page` task that was executed: `values` is [page]. Otherwise as `TaskRecord`."""


class TruthRecord(_Line, frozen=True, tag="truth"):
    """The plant's true state, see `Plant.truth`: for the viewer and the grader; no node can read it."""

    seq: Seq
    t: float
    poses: dict[str, Annotated[list[float], msgspec.Meta(min_length=7, max_length=7)]]
    vectors: dict[str, Annotated[list[float], msgspec.Meta(min_length=6, max_length=6)]]
    values: dict[str, float]


class BeginRecord(_OfNode, frozen=True, tag="begin"):
    """What a component scheduled in `begin`, before the first task."""

    component: str
    returned: list[ReturnedTask]


class ErrorRecord(_OfNode, frozen=True, tag="error"):
    """Something went wrong in a component; `cause` is the seq of the node's record before, usually the task's own."""

    cause: Seq
    component: str
    message: str


class LogLineRecord(_OfNode, frozen=True, tag="said"):
    """A line that a component printed or logged; `cause` is the seq of the node's record before, as of an error.

    Args:
        level: PRINT, or INFO, WARNING and so on of its log.
        text: without the line end, at most `MAX_LOG_LINE_CHARS`.
    """

    cause: Seq
    component: str
    level: str
    text: str


class EndRecord(_OfNode, frozen=True, tag="end"):
    """A node has ended: why, and its counts."""

    reason: str
    summary: dict[str, Any]


Record: TypeAlias = (
    InputRecord | TaskRecord | PageRecord | TruthRecord | BeginRecord | ErrorRecord | LogLineRecord | EndRecord
)
Line: TypeAlias = (
    InputRecord | RepeatLine | TaskLine | PageLine | TruthRecord | BeginRecord | ErrorRecord | LogLineRecord | EndRecord
)

_encode = msgspec.json.Encoder().encode
decode_beginning: Callable[[bytes], TraceInfo | Header] = msgspec.json.Decoder(TraceInfo | Header).decode
decode_line: Callable[[bytes], Line] = msgspec.json.Decoder(Line).decode


def encode_record(record: TraceInfo | Header | Line | Record) -> bytes:
    """Return the JSON of a line as in the file, without the newline, or of a whole record."""
    return _encode(record)


def digest_of(data: bytes = b"") -> hashlib.blake2b:
    """Return the digest object of a trace, updated with these bytes; the first line is not part of it."""
    return hashlib.blake2b(data, digest_size=32)


def name_of(asked: str) -> str:
    """Return the name of a scenario or controller that was requested by name or as a file.

    >>> name_of("pad"), name_of("/home/me/my_pad.py"), name_of("")
    ('pad', 'my_pad', '')
    """
    return Path(asked).stem
