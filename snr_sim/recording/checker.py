"""Checker of a replay: returns the tickets of the recorded tasks and compares what handlers return with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import msgspec

from snr_sim.core.handlers import handler_name
from snr_sim.core.machine import HandlerError
from snr_sim.core.node_report import INTERRUPTED
from snr_sim.core.source_location import describe_error
from snr_sim.prelude.errors import ComponentFailedError, SnrError
from snr_sim.prelude.recorder import Handled, TaskRef
from snr_sim.prelude.task import Task, TaskType
from snr_sim.recording.compare import Difference, Tolerance, first_difference, only_reordered
from snr_sim.recording.node_trace import encode_task, process_of
from snr_sim.recording.nondeterminism import unwatched
from snr_sim.recording.records import (
    BeginRecord,
    ErrorRecord,
    Executed,
    HandlerCall,
    InputRecord,
    LogLineRecord,
    PageRecord,
    Record,
    ReturnedTask,
    TaskRecord,
)

MAX_DIVERGENCES = 1000
# Limit of follow-up tasks after a task that is not in the recording, since it may schedule itself without end.
MAX_FOLLOW_UPS = 100

_encode = msgspec.json.Encoder().encode

ORDER_HINT = (
    "The same values in another order: the order of a set of texts differs from process to process; "
    "sort it, for name in sorted(names), or keep a list or a dict."
)
HANDLER = "the handler itself"  # the field of a difference: called only in the recording, or only in the replay
_NONE = "no exception"

Label: TypeAlias = tuple[str, str]  # component and handler
Compared: TypeAlias = Executed | BeginRecord  # a record with tasks that components returned


@dataclass(frozen=True)
class Divergence:
    """One difference between the replay and the recording."""

    seq: int  # of the recorded task whose handling differs, as the next two
    t: float
    node: str
    task: str  # that task, as text
    component: str  # whose result differs
    handler: str
    kind: str  # 'value', 'missing', 'extra', 'reordered' or 'raised'
    field: str  # path to the value, or the task that is missing or extra
    recorded: Any
    replayed: Any
    causes: list[str]  # from the input to the task, one line each
    is_command: bool  # whether the differing page drives an actuator
    hint: str = ""  # likely cause, if the difference matches a known pattern


@dataclass
class NodeReplay:
    """Result of replaying one node."""

    node: str
    executed: int = 0
    recorded: int = 0
    divergences: list[Divergence] = field(default_factory=list)
    records: list[Record] = field(default_factory=list)  # what a trace of the replay would hold, with recorded seqs

    @property
    def is_identical(self) -> bool:
        """Whether the replay equals the recording."""
        return not self.divergences


class ReplayChecker:
    """Stand-in for the recorder: returns tickets of the recorded tasks, and compares."""

    def __init__(self, node: str, records: Sequence[Record], commands: Sequence[str], tolerances: Sequence[Tolerance]):
        self.result: NodeReplay = NodeReplay(node, recorded=sum(isinstance(record, Executed) for record in records))
        self.entering: InputRecord | None = None
        self._by_seq: dict[int, Record] = {record.seq: record for record in records}
        self._by_cause: dict[tuple[int, int], Executed] = {
            (record.cause, record.index): record for record in records if isinstance(record, Executed)
        }
        self._began: BeginRecord | None = None  # the node's own
        self._begins = {record.component: record for record in records if isinstance(record, BeginRecord)}
        self._failed: dict[int, dict[str, str]] = {}  # by seq of the task: what each component raised
        for record in records:
            if isinstance(record, ErrorRecord):
                self._failed.setdefault(self._before_output(record.cause), {})[record.component] = record.message
        self._commands = set(commands)
        self._tolerances = tolerances
        self._extra = 0  # tasks the recording does not have get causes below zero
        self._follow_ups: dict[int, list[int]] = {}  # of such a cause: how many followed its first one; shared by all
        self._current: Executed | None = None
        self._gone: list[HandlerCall] = []  # components that handled the current task in the recording and have not yet

    def _before_output(self, seq: int) -> int:
        """Return the seq of the newest record up to this one that is not a printed or logged line."""
        while isinstance(record := self._by_seq.get(seq), LogLineRecord):
            seq = record.cause
        return seq

    def for_node(self, name: str) -> ReplayChecker:
        """Return itself: a replay has one node."""
        return self

    def record_of(self, task_ref: TaskRef) -> Executed | None:
        """Return the recorded task that corresponds to a replayed one, or None if there is none."""
        return self._by_cause.get((task_ref[1], task_ref[2]))

    def was_unexecuted(self, task_ref: TaskRef) -> bool:
        """Return whether the recording has this task as scheduled, but ended before it was executed."""
        return task_ref[1] > 0 and self.record_of(task_ref) is None

    def was_interrupted(self, record: Executed) -> bool:
        """Return whether a handler of this task did not return until a signal ended the run."""
        return any(message.startswith(INTERRUPTED) for message in self._failed.get(record.seq, {}).values())

    # The NodeRecorder interface

    def begun(self, now_s: float, component: str, scheduled: Sequence[Task]) -> list[TaskRef]:
        """Compare what a component schedules in `begin`."""
        found = self._begins.pop(component, None)
        if component == self.result.node:
            self._began = found
        record = found or self._began  # a component that scheduled nothing then has no record of its own
        recorded = found.returned if found is not None else []
        seq = record.seq if record is not None else 0
        task_refs, returned = self._compare_outputs(seq, scheduled, recorded, 0, (component, "begin"), record)
        self.result.records.append(BeginRecord(seq, now_s, self.result.node, component, returned))
        return task_refs

    def report_missing_begins(self) -> None:
        """Report the components that scheduled tasks in `begin` in the recording, but not in the replay."""
        for record in self._begins.values():
            self._compare_order(record, (record.component, "begin"), record.returned, [])

    def input(self, now_s: float, source: str, task: Task) -> TaskRef:
        """Return the ticket of the recorded input."""
        record = self.entering
        assert record is not None
        self.result.records.append(record)
        return (task, record.seq, 0, ReturnedTask(record.type, record.name, record.values))

    @unwatched
    def task(self, now_s: float, task_ref: TaskRef, handled: Sequence[Handled]) -> list[TaskRef]:
        """Compare what the handlers of a task returned."""
        task, cause, index, encoded = task_ref
        record = self._current = self.record_of(task_ref)
        task_refs: list[TaskRef] = []
        by: list[HandlerCall] = []
        then = {one.component: one for one in record.handled} if record is not None else {}
        offsets = _offsets(record)
        seq = record.seq if record is not None else cause
        for label, outputs in handled:
            before = then.pop(label[0], None)
            if before is None and record is not None:
                self._check_new_call(record, label, outputs)
            recorded = before.returned if before is not None else []
            # The node's own task carries the page that this one brought, which was compared where that was made.
            is_stored = process_of(task, [(label, outputs)])
            made = [ReturnedTask(TaskType.process_data, encoded.name, encoded.values)] if is_stored else None
            offset = offsets.get(label[0], 0)
            more, returned = self._compare_outputs(seq, outputs, recorded, offset, label, record, made)
            task_refs.extend(more)
            by.append(HandlerCall(*label, returned))
        self._gone = list(then.values())
        kind = PageRecord if task.type is TaskType.store_page else TaskRecord
        seq = record.seq if record is not None else 0
        self.result.records.append(
            kind(seq, now_s, self.result.node, encoded.type, encoded.name, encoded.values, cause, index, by)
        )
        return task_refs

    def error(self, now_s: float, component: str, message: str) -> None:
        """Do nothing: a replay reports failures through `check_failure`."""

    def record_text(self, now_s: float, component: str, level: str, text: str) -> None:
        """Ignore printed and logged text: it does not affect the run."""

    def end(self, now_s: float, reason: str, summary: dict[str, Any]) -> None:
        """Compare nothing: the counts follow from the tasks."""

    # Failures, and handlers that are gone

    def check_failure(self, failed: HandlerError, error: BaseException) -> None:
        """Compare a failure of a handler with the recorded one."""
        record = self._current
        if record is None:
            return  # in a task that is not in the recording; that difference is already reported
        component = failed.component.name if failed.component is not None else ""  # the failing component is unknown
        then = self._failed.get(record.seq, {}).get(component)
        if then is None or (type(error).__name__ not in then and not isinstance(error, SnrError)):
            raised = Difference("exception", _first_lines(then or _NONE), _first_lines(describe_error(error, "")))
            self._diverge(record, (component, self._handler_of(failed)), "raised", raised)

    def report_missing_calls(self) -> None:
        """Report the handlers that were called for this task in the recording, but not in the replay."""
        for one in self._gone:
            assert self._current is not None
            label = one.component, one.handler
            if one.returned:
                self._compare_order(self._current, label, one.returned, [])
            else:
                self._diverge(self._current, label, "missing", Difference(HANDLER, "called", "not called"))

    def check_failure_outside_task(self, failure: ComponentFailedError, step: str) -> None:
        """Compare a failure in `begin`, or in `halt` and `terminate`, with the recorded one."""
        if any(failure.component in failed for failed in self._failed.values()):
            return
        record = self._current or next((one for one in self._by_seq.values() if isinstance(one, BeginRecord)), None)
        if record is not None:
            raised = Difference("exception", _NONE, _first_lines(failure.message))
            self._diverge(record, (failure.component, step), "raised", raised)

    def _check_new_call(self, record: Executed, label: Label, outputs: Sequence[Task]) -> None:
        """Report a handler without recorded result: it is new, or it raised in the recording."""
        failure = self._failed.get(record.seq, {}).get(label[0])
        if failure is not None:
            self._diverge(record, label, "raised", Difference("exception", _first_lines(failure), _NONE))
        elif not outputs:
            self._diverge(record, label, "extra", Difference(HANDLER, "not called", "called"))

    @staticmethod
    def _handler_of(failed: HandlerError) -> str:
        handlers = failed.component.task_handlers if failed.component is not None else {}
        handler = handlers.get(failed.task.id()) or handlers.get(failed.task.type)
        return handler_name(handler) if handler is not None else ""

    # Comparison

    def _compare_outputs(
        self,
        seq: int,
        outputs: Sequence[Task],
        recorded: Sequence[ReturnedTask],
        offset: int,
        label: Label,
        record: Compared | None,
        known: list[ReturnedTask] | None = None,
    ) -> tuple[list[TaskRef], list[ReturnedTask]]:
        """Pair outputs with recorded ones and compare them; return their tickets and their record form.

        Values of outputs that are `known`, that is, already in record form, are not compared.
        """
        returned = known or [encode_task(task) for task in outputs]
        count_before = len(self.result.divergences)
        pairs = _match_tasks(recorded, returned)
        task_refs: list[TaskRef] = []
        for task, encoded, place in zip(outputs, returned, pairs, strict=True):
            if place is None or record is None:
                task_refs.extend(self._extra_ticket(task, encoded, seq))
                continue
            task_refs.append((task, seq, offset + place, encoded))
            if known is None:
                self._compare_values(record, label, recorded[place], encoded)
        if record is not None:
            self._compare_order(record, label, recorded, returned)
        if len(self.result.divergences) > count_before and only_reordered(*map(_as_json, (recorded, returned))):
            self.result.divergences[count_before:] = [
                replace(divergence, hint=ORDER_HINT) for divergence in self.result.divergences[count_before:]
            ]
        return task_refs, returned

    def _extra_ticket(self, task: Task, encoded: ReturnedTask, cause: int) -> list[TaskRef]:
        """Return the ticket of a task that the recording does not have; none if too many came from one such task."""
        follow_ups = self._follow_ups.get(cause) or [0]
        follow_ups[0] += 1
        if follow_ups[0] > MAX_FOLLOW_UPS:
            return []
        self._extra -= 1
        self._follow_ups[self._extra] = follow_ups
        return [(task, self._extra, 0, encoded)]

    def _compare_values(self, record: Compared, label: Label, then: ReturnedTask, now: ReturnedTask) -> None:
        difference = first_difference(then.name, then.type, bytes(then.values), bytes(now.values), self._tolerances)
        if difference is not None:
            self._diverge(record, label, "value", difference, _id(then))

    def _compare_order(
        self, record: Compared, label: Label, recorded: Sequence[ReturnedTask], returned: Sequence[ReturnedTask]
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
                shown = " ".join(one)
                pair = (shown, None) if kind == "missing" else (None, shown)
                self._diverge(record, label, kind, Difference(shown, *pair), one)
        if sorted(then) == sorted(now):
            orders = ([" ".join(one) for one in ids] for ids in (then, now))
            self._diverge(record, label, "reordered", Difference("order", *orders))

    def _diverge(
        self, record: Compared, label: Label, kind: str, difference: Difference, task_id: tuple[str, str] = ("", "")
    ) -> None:
        """Add a divergence; `task_id` is that of the returned task that differs."""
        if len(self.result.divergences) >= MAX_DIVERGENCES:
            return
        task = "begin" if isinstance(record, BeginRecord) else f"{record.type} '{record.name}'"
        is_command = task_id[0] == TaskType.store_page and task_id[1] in self._commands
        found = difference.field, difference.recorded, difference.replayed
        causes = list(self._causes(record))
        self.result.divergences.append(
            Divergence(record.seq, record.t, record.node, task, *label, kind, *found, causes, is_command)
        )

    def _causes(self, record: Compared) -> Iterator[str]:
        """Yield the chain of causes from the input to a record, one line each."""
        chain: list[Record | Executed] = [record]
        while isinstance(chain[-1], Executed) and chain[-1].cause in self._by_seq:
            chain.append(self._by_seq[chain[-1].cause])
        for one in reversed(chain):
            if isinstance(one, InputRecord):
                yield f"seq {one.seq}: {one.source} brought {one.type} '{one.name}'"
            elif isinstance(one, BeginRecord):
                yield f"seq {one.seq}: {one.component} began"
            elif isinstance(one, Executed):
                handlers = ", ".join(f"{by.component}.{by.handler}" for by in one.handled) or "nobody"
                yield f"seq {one.seq}: {one.type} '{one.name}' went to {handlers}"


def _as_json(returned: Sequence[ReturnedTask]) -> list[bytes]:
    return [_encode(one) for one in returned]


def _id(returned: ReturnedTask) -> tuple[str, str]:
    return (str(returned.type), returned.name)


def _match_tasks(recorded: Sequence[ReturnedTask], returned: Sequence[ReturnedTask]) -> list[int | None]:
    """Return for each returned task the index of the recorded one with the same id and the same occurrence."""
    places: dict[tuple[str, str], list[int]] = {}
    for place, one in enumerate(recorded):
        places.setdefault(_id(one), []).append(place)
    return [found.pop(0) if (found := places.get(_id(one))) else None for one in returned]


def _offsets(record: Executed | None) -> dict[str, int]:
    """Return the index among all tasks of a record at which each component's tasks begin."""
    offsets: dict[str, int] = {}
    place = 0
    for one in record.handled if record is not None else []:
        offsets[one.component] = place
        place += len(one.returned)
    return offsets


def _first_lines(message: str) -> str:
    """Return the line and the exception of a failure, without its time."""
    return " | ".join(line.strip() for line in message.splitlines()[:2] if line.strip())
