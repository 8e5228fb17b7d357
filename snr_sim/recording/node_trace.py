"""One node's part of the trace: its inputs, and every task it executes, as records."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import Raw

from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.page import Page
from snr_sim.prelude.recorder import Handled, Ticket
from snr_sim.prelude.task import Task, TaskType
from snr_sim.prelude.values import MARK, encode_value
from snr_sim.recording.records import (
    BeginRecord,
    By,
    EndRecord,
    ErrorRecord,
    InputRecord,
    PageRecord,
    Returned,
    TaskRecord,
)

if TYPE_CHECKING:
    from snr_sim.recording.trace import TraceWriter

_encode = msgspec.json.Encoder().encode
_NO_VALUES = b"[]"
_STORE_PAGE = TaskType.store_page  # looked up once: in Python 3.11 a member of an Enum takes 0.1 us to find


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
        told = told_of(task)
        self._writer.put(_encode(InputRecord(seq, now_s, self._node, source, told.type, told.name, told.values)))
        return (task, seq, 0, told)

    def task(self, now_s: float, ticket: Ticket, handled: Sequence[Handled]) -> list[Ticket]:
        """Takes down an executed task; returns a ticket for each task its handlers returned, in order."""
        writer = self._writer
        self._newest = writer.seq = seq = writer.seq + 1
        task, cause, nth, told = ticket
        tickets: list[Ticket] = []
        by = [By(label[0], label[1], _returned(outputs, seq, tickets)) for label, outputs in handled]
        kind = PageRecord if task.type is _STORE_PAGE else TaskRecord
        writer.put(_encode(kind(seq, now_s, self._node, told.type, told.name, told.values, cause, nth, by)))
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
        told = told_of(task)
        tickets.append((task, seq, len(tickets), told))
        returned.append(told)
    return returned


def told_of(task: Task) -> Returned:
    """Returns a task as it stands in a record."""
    return Returned(*_id_in_words(task), Raw(_encode_values(task)))


def _encode_values(task: Task) -> bytes:
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


def _id_in_words(task: Task) -> tuple[str, str]:
    """Returns a task's type and name; as text also where they are none, which the node is about to complain about."""
    kind: Any = task.type
    name: Any = task.name
    if isinstance(kind, str) and isinstance(name, str):
        return kind, name
    return str(kind), str(name)
