"""The lines of `trace.jsonl`. Each is one JSON object with a `kind`; together they are the whole run.

`seq` is the order, over all nodes of the run; `t` is virtual time and never the order. `values` is the list a task
carried, as `prelude/values.py` writes it, left encoded here because most readers want only some of it.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, TypeAlias

import msgspec

SCHEMA = 1


class Header(msgspec.Struct, frozen=True, tag_field="kind", tag="header"):
    """The first line: what ran, of what version, from which seeds and sources.

    Args:
        schema: version of this format; a reader refuses others.
        kit, python, platform, packages: versions of what computed the run.
        scenario, robot, controller, roles, engine, io, seed, options: what was asked for.
        nodes: name of the node of each role, in the order they run.
        clock: 'sim' (stepped) or 'wall' (threads).
        commands: keys of pages that drive actuators, per node.
        sources: sha256 of every source file of robot, controller and scenario, by path relative to its folder.
        scene: shapes of the plant, see `Plant.scene`.
        wall: when and where it ran; not part of the digest.
    """

    schema: int
    kit: str
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
    wall: dict[str, Any]


class Returned(msgspec.Struct, frozen=True, array_like=True):
    """A task that a handler returned: [type, name, values]."""

    type: str
    name: str
    values: msgspec.Raw


class By(msgspec.Struct, frozen=True):
    """One handler's part in a task."""

    by: str
    handler: str
    returned: list[Returned]


class InputRecord(msgspec.Struct, frozen=True, tag_field="kind", tag="input"):
    """A task that came through the door, from the loop, link or person named in `source`."""

    seq: int
    t: float
    node: str
    source: str
    type: str
    name: str
    values: msgspec.Raw


class TaskRecord(msgspec.Struct, frozen=True, tag_field="kind", tag="task"):
    """A task that was executed, and what its handlers returned.

    Args:
        cause: seq of the record that brought it (an input, a task, a page; 0: a component's `begin`).
        nth: position among the tasks of that record.
    """

    seq: int
    t: float
    node: str
    type: str
    name: str
    values: msgspec.Raw
    cause: int
    nth: int
    handled: list[By]


class PageRecord(msgspec.Struct, frozen=True, tag_field="kind", tag="page"):
    """A `store_page` task that was executed: `values` is [page]. Otherwise as `TaskRecord`."""

    seq: int
    t: float
    node: str
    type: str
    name: str
    values: msgspec.Raw
    cause: int
    nth: int
    handled: list[By]


class TruthRecord(msgspec.Struct, frozen=True, tag_field="kind", tag="truth"):
    """The plant's true state, see `Plant.truth`: for the viewer and the grader; no node can read it."""

    seq: int
    t: float
    poses: dict[str, list[float]]
    arrows: dict[str, list[float]]
    values: dict[str, float]


class BeginRecord(msgspec.Struct, frozen=True, tag_field="kind", tag="begin"):
    """What a component scheduled in `begin`, before the first task."""

    seq: int
    t: float
    node: str
    by: str
    returned: list[Returned]


class ErrorRecord(msgspec.Struct, frozen=True, tag_field="kind", tag="error"):
    """Something went wrong in a component; `cause` is the seq of the node's record before, usually the task's own."""

    seq: int
    t: float
    node: str
    cause: int
    component: str
    message: str


class EndRecord(msgspec.Struct, frozen=True, tag_field="kind", tag="end"):
    """A node has ended: why, and its counts. `wall` is not part of the digest."""

    seq: int
    t: float
    node: str
    reason: str
    summary: dict[str, Any]


Record: TypeAlias = InputRecord | TaskRecord | PageRecord | TruthRecord | BeginRecord | ErrorRecord | EndRecord

_encode = msgspec.json.Encoder().encode
decode_header = msgspec.json.Decoder(Header).decode
decode_record = msgspec.json.Decoder(Record).decode


def encode_record(record: Header | Record) -> bytes:
    """Returns a header or record as it stands in the file, without the newline."""
    return _encode(record)


def digest_of_header(header: Header) -> hashlib.blake2b:
    """Returns a BLAKE2b-256 digest that has taken in the header, but for when and from which folders it was run."""
    names = {"scenario": Path(header.scenario).stem, "controller": Path(header.controller).stem}
    return hashlib.blake2b(_encode(msgspec.structs.replace(header, wall={}, **names)), digest_size=32)
