"""Replay: the same handlers on the inputs of a recorded run, compared task by task.

The node of a replay has no loops. The trace brings what they brought, in the same order and at the same moments, and
a checker takes the recorder's place: it gives each replayed task the ticket of the recorded one it answers to, and
compares what the handlers return. A task is known by its cause and its place among its cause's tasks, so after a
difference the rest is still compared with what it belongs to.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from msgspec import Raw

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import Config
from snr_sim.core.machine import HandlerFailed
from snr_sim.core.node import Node
from snr_sim.core.recording_machine import RecordingMachine
from snr_sim.prelude.errors import TraceError, ValueEncodingError
from snr_sim.prelude.page import KINDS
from snr_sim.prelude.recorder import Handled, Ticket
from snr_sim.prelude.task import Task, TaskType
from snr_sim.prelude.values import decode_value
from snr_sim.recording.compare import Tolerance, first_difference
from snr_sim.recording.records import (
    BeginRecord,
    By,
    ErrorRecord,
    InputRecord,
    PageRecord,
    Record,
    Returned,
    TaskRecord,
)
from snr_sim.recording.trace import Trace, encode_values

Executed: TypeAlias = TaskRecord | PageRecord
MAX_DIVERGENCES = 1000


@dataclass(frozen=True)
class Divergence:
    """One place where the replay did something else than the recording.

    Args:
        seq, t, node: of the recorded task whose handling differs.
        task: that task, in words.
        component, handler: whose answer differs.
        kind: 'value', 'missing', 'extra', 'reordered' or 'raised'.
        field: path to the value, or the task that is missing or extra.
        recorded, replayed: what stood there.
        causes: from the input to the task, one line each.
        is_command: what differs drives an actuator.
    """

    seq: int
    t: float
    node: str
    task: str
    component: str
    handler: str
    kind: str
    field: str
    recorded: Any
    replayed: Any
    causes: list[str]
    is_command: bool


@dataclass
class NodeReplay:
    """What came out of replaying one node."""

    node: str
    executed: int = 0
    recorded: int = 0
    divergences: list[Divergence] = field(default_factory=list)
    records: list[Record] = field(default_factory=list)  # what a trace of the replay would hold, with recorded seqs

    @property
    def is_identical(self) -> bool:
        """Whether everything was as recorded."""
        return not self.divergences

    @property
    def first_command(self) -> Divergence | None:
        """The first difference that would have moved an actuator: after it, the recorded sensors answer other code."""
        return next((divergence for divergence in self.divergences if divergence.is_command), None)


class ReplayClock(SimClock):
    """Shows the recorded time."""

    def show(self, time_s: float) -> None:
        """Sets the time."""
        self._now_s = time_s


def replay_node(trace: Trace, role: str, config: Config, tolerances: Sequence[Tolerance] = ()) -> NodeReplay:
    """Replays one node of a run.

    Args:
        trace: of the run.
        role: of the node.
        config: with the same endpoints, or changed ones; its loops are left out.
        tolerances: differences to let pass.

    Raises:
        TraceError: an input of the trace cannot be brought back.
        ConfigError: the config has no such role.
    """
    name = f"{role}_node"
    records = [record for record in trace.records if getattr(record, "node", None) == name]
    checker = _Checker(name, records, trace.header.commands.get(name, []), tolerances)
    clock = ReplayClock()
    node = Node(role, config, clock=clock, recorder=checker, seed=trace.header.seed, is_replay=True)
    _Driver(node, clock, checker, is_lock_step=trace.header.clock == "sim").run(records)
    checker.result.executed = node.machine.executed
    return checker.result


class _Driver:
    """Brings the inputs and has the tasks executed, in the recorded order."""

    def __init__(self, node: Node, clock: ReplayClock, checker: _Checker, is_lock_step: bool) -> None:
        assert isinstance(node.machine, RecordingMachine)
        self._node = node
        self._machine = node.machine
        self._clock = clock
        self._checker = checker
        self._is_lock_step = is_lock_step

    def run(self, records: Sequence[Record]) -> None:
        self._show(next((record.t for record in records if isinstance(record, BeginRecord)), 0.0))
        self._node.begin()
        self._checker.all_begun()
        before: Record | None = None
        for record in records:
            if isinstance(record, InputRecord):
                # In lock step an input comes when nothing is left to do, or together with another one.
                if self._is_lock_step and not isinstance(before, InputRecord):
                    self._finish()
                self._show(record.t)
                self._checker.entering = record
                self._machine.admit(_input_task(record), record.source)
            elif isinstance(record, (TaskRecord, PageRecord)):
                self._execute(record)
            before = record
        self._finish()
        self._node.end("replayed")

    def _show(self, time_s: float) -> None:
        self._clock.show(time_s)
        self._machine.now_s = time_s

    def _execute(self, record: Executed) -> None:
        """Executes the task of this record, and before it what the recording does not have."""
        while (ticket := self._machine.next_ticket) is not None:
            expected = self._checker.record_of(ticket)
            if expected is not None and expected.seq > record.seq:
                return  # the recorded task is missing here; that was said when its cause did not return it
            if expected is record:
                self._show(record.t)
            self._execute_next()
            if expected is record:
                return

    def _finish(self) -> None:
        """Executes what is left; that is nothing, unless the code has changed. What asks for itself is cut off."""
        for _ in range(10_000):
            if self._machine.next_ticket is None:
                return
            self._execute_next()

    def _execute_next(self) -> None:
        try:
            self._machine.execute_next()
        except HandlerFailed as failed:
            error = failed.__cause__
            if not isinstance(error, Exception):
                raise
            self._checker.raised(failed, error)


class _Checker:
    """Takes the recorder's place: hands out tickets of the recorded tasks, and compares."""

    def __init__(self, node: str, records: Sequence[Record], commands: Sequence[str], tolerances: Sequence[Tolerance]):
        self.result = NodeReplay(node, recorded=sum(isinstance(record, (TaskRecord, PageRecord)) for record in records))
        self.entering: InputRecord | None = None
        self._by_seq: dict[int, Record] = {record.seq: record for record in records}
        self._by_cause: dict[tuple[int, int], Executed] = {
            (record.cause, record.nth): record for record in records if isinstance(record, (TaskRecord, PageRecord))
        }
        self._begins = {record.by: record for record in records if isinstance(record, BeginRecord)}
        self._errors = {record.cause: record for record in records if isinstance(record, ErrorRecord)}
        self._commands = set(commands)
        self._tolerances = tolerances
        self._extra = 0  # tasks the recording does not have get causes below zero
        self._current: Executed | None = None

    def for_node(self, name: str) -> _Checker:
        """Returns itself: a replay has one node."""
        return self

    def record_of(self, ticket: Ticket) -> Executed | None:
        """Returns the recorded task that a replayed one answers to, or None if the recording has none."""
        return self._by_cause.get((ticket[1], ticket[2]))

    # The NodeRecorder promise

    def begun(self, now_s: float, component: str, scheduled: Sequence[Task]) -> list[Ticket]:
        """Compares what a component schedules in `begin`."""
        record = self._begins.pop(component, None)
        recorded = record.returned if record is not None else []
        seq = record.seq if record is not None else 0
        tickets, returned = self._answer(seq, scheduled, recorded, 0, (component, "begin"), record)
        self.result.records.append(BeginRecord(seq, now_s, self.result.node, component, returned))
        return tickets

    def all_begun(self) -> None:
        """Compares with the components that scheduled something in `begin` then, and nothing now."""
        for record in self._begins.values():
            self._compare_order(record, (record.by, "begin"), record.returned, [])

    def input(self, now_s: float, source: str, task: Task) -> Ticket:
        """Hands out the ticket of the recorded input."""
        record = self.entering
        assert record is not None
        self.result.records.append(record)
        return (task, record.seq, 0, bytes(record.values))

    def task(self, now_s: float, ticket: Ticket, handled: Sequence[Handled]) -> list[Ticket]:
        """Compares what the handlers of a task returned."""
        task, cause, nth, values = ticket
        record = self._current = self.record_of(ticket)
        tickets: list[Ticket] = []
        by: list[By] = []
        recorded_by = {(one.by, one.handler): one.returned for one in record.handled} if record is not None else {}
        offsets = _offsets(record)
        for label, outputs in handled:
            seq = record.seq if record is not None else 0
            more, returned = self._answer(
                seq, outputs, recorded_by.pop(label, []), offsets.get(label, 0), label, record
            )
            tickets.extend(more)
            by.append(By(label[0], label[1], returned))
        if record is not None and record.seq not in self._errors:
            for label, gone in recorded_by.items():
                self._compare_order(record, label, gone, [])
        kind = PageRecord if task.type is TaskType.store_page else TaskRecord
        seq = record.seq if record is not None else 0
        self.result.records.append(
            kind(seq, now_s, self.result.node, task.type, task.name, Raw(values), cause, nth, by)
        )
        return tickets

    def error(self, now_s: float, component: str, message: str) -> None:
        """A replay reports failures through `raised`."""

    def end(self, now_s: float, reason: str, summary: dict[str, Any]) -> None:
        """Nothing to compare: counts follow from the tasks."""

    def raised(self, failed: HandlerFailed, error: Exception) -> None:
        """Compares a failure of a handler with the recorded one."""
        record = self._current
        if record is None or record.seq in self._errors:
            return  # failed then, too
        component = failed.component.name if failed.component is not None else self.result.node
        self._diverge(
            record, (component, ""), "raised", "exception", "no exception", f"{type(error).__name__}: {error}"
        )

    # Comparison

    def _answer(
        self,
        seq: int,
        outputs: Sequence[Task],
        recorded: Sequence[Returned],
        offset: int,
        label: tuple[str, str],
        record: Executed | BeginRecord | None,
    ) -> tuple[list[Ticket], list[Returned]]:
        """Pairs outputs with recorded ones and compares; returns their tickets, and them as they stand in a record."""
        encoded = [(task, encode_values(task)) for task in outputs]
        returned = [Returned(task.type, task.name, Raw(values)) for task, values in encoded]
        pairs = _paired(recorded, returned)
        tickets: list[Ticket] = []
        for (task, values), place in zip(encoded, pairs, strict=True):
            if place is None or record is None:
                self._extra -= 1
                tickets.append((task, self._extra, 0, values))
                continue
            tickets.append((task, seq, offset + place, values))
            self._compare_values(record, label, recorded[place], values)
        if record is not None:
            self._compare_order(record, label, recorded, returned)
        return tickets, returned

    def _compare_values(
        self, record: Executed | BeginRecord, label: tuple[str, str], recorded: Returned, values: bytes
    ) -> None:
        difference = first_difference(recorded.name, recorded.type, bytes(recorded.values), values, self._tolerances)
        if difference is not None:
            is_command = recorded.type == TaskType.store_page and recorded.name in self._commands
            self._diverge(
                record, label, "value", difference.field, difference.recorded, difference.replayed, is_command
            )

    def _compare_order(
        self,
        record: Executed | BeginRecord,
        label: tuple[str, str],
        recorded: Sequence[Returned],
        returned: Sequence[Returned],
    ) -> None:
        then, now = [_id(one) for one in recorded], [_id(one) for one in returned]
        if then == now:
            return
        for kind, ours, theirs in (("missing", then, now), ("extra", now, then)):
            left = list(theirs)
            for one in ours:
                if one in left:
                    left.remove(one)
                    continue
                is_command = one[0] == TaskType.store_page and one[1] in self._commands
                shown = " ".join(one)
                recorded_one, replayed_one = (shown, None) if kind == "missing" else (None, shown)
                self._diverge(record, label, kind, shown, recorded_one, replayed_one, is_command)
        if sorted(then) == sorted(now):
            orders = ([" ".join(one) for one in ids] for ids in (then, now))
            self._diverge(record, label, "reordered", "order", next(orders), next(orders))

    def _diverge(
        self,
        record: Executed | BeginRecord,
        label: tuple[str, str],
        kind: str,
        where: str,
        recorded: Any,
        replayed: Any,
        is_command: bool = False,
    ) -> None:
        if len(self.result.divergences) >= MAX_DIVERGENCES:
            return
        task = "begin" if isinstance(record, BeginRecord) else f"{record.type} '{record.name}'"
        self.result.divergences.append(
            Divergence(
                record.seq, record.t, record.node, task, label[0], label[1], kind, where, recorded, replayed,
                list(self._causes(record)), is_command,
            )
        )  # fmt: skip

    def _causes(self, record: Record) -> Iterator[str]:
        """Yields the way from the input to a record."""
        chain: list[Record] = [record]
        while isinstance(chain[-1], (TaskRecord, PageRecord)) and chain[-1].cause in self._by_seq:
            chain.append(self._by_seq[chain[-1].cause])
        for one in reversed(chain):
            if isinstance(one, InputRecord):
                yield f"seq {one.seq}: {one.source} brought {one.type} '{one.name}'"
            elif isinstance(one, BeginRecord):
                yield f"seq {one.seq}: {one.by} began"
            elif isinstance(one, (TaskRecord, PageRecord)):
                handlers = ", ".join(f"{by.by}.{by.handler}" for by in one.handled) or "nobody"
                yield f"seq {one.seq}: {one.type} '{one.name}' went to {handlers}"


def _id(returned: Returned) -> tuple[str, str]:
    return (str(returned.type), returned.name)


def _paired(recorded: Sequence[Returned], returned: Sequence[Returned]) -> list[int | None]:
    """Returns for each returned task the place of the recorded one it answers to: the same id, the same time round."""
    places: dict[tuple[str, str], list[int]] = {}
    for place, one in enumerate(recorded):
        places.setdefault(_id(one), []).append(place)
    return [found.pop(0) if (found := places.get(_id(one))) else None for one in returned]


def _offsets(record: Executed | None) -> dict[tuple[str, str], int]:
    """Returns at which place among all tasks of a record each handler's tasks begin."""
    offsets: dict[tuple[str, str], int] = {}
    place = 0
    for one in record.handled if record is not None else []:
        offsets[(one.by, one.handler)] = place
        place += len(one.returned)
    return offsets


def _input_task(record: InputRecord) -> Task:
    try:
        values = decode_value(bytes(record.values), KINDS)
        return Task(TaskType(record.type), record.name, values)
    except (ValueEncodingError, ValueError) as error:
        raise TraceError(
            f"Input {record.type} '{record.name}' (seq {record.seq}) cannot be brought back: {error}",
            fix="loops should store plain data: numbers, text, lists, dicts, numpy arrays.",
        ) from error
