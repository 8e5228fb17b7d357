"""Replay: the same handlers on the inputs of a recorded run, compared task by task.

The node of a replay has no loops. The trace provides their inputs in the same order and at the same times, and a
checker replaces the recorder: it gives each replayed task the ticket of the corresponding recorded one, and compares
what the handlers return. A task is identified by its cause and its index among its cause's tasks, so after a
difference the remaining tasks are still compared with their counterparts.

In lock step an input is brought when nothing is left to do, on the wall clock after as many tasks as then. A reload is
repeated with the text that it read then, by the `sources` of its page. Output of components is neither needed nor
compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import Config
from snr_sim.core.machine import HandlerError
from snr_sim.core.node import Node
from snr_sim.core.watchdog import Watchdog
from snr_sim.prelude.errors import ComponentFailedError, TraceError, ValueEncodingError
from snr_sim.prelude.task import KINDS, Page, Task, TaskType
from snr_sim.prelude.tasks import ADD_COMPONENT_TASK_NAME, REMOVE_COMPONENT_TASK_NAME
from snr_sim.prelude.values import decode_value
from snr_sim.recording.checker import NodeReplay, ReplayChecker
from snr_sim.recording.compare import Tolerance
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import BeginRecord, Executed, InputRecord, Record, TaskRecord

# The text that describes the reloaded code does not count as a difference in behaviour. Nor does the text of a failure:
# it names a file relative to the folder in which the run was started, and Python's messages differ between versions.
UNCOMPARED: tuple[str, ...] = (
    f"{TaskType.reload}.sources*=ignore",
    *(f"{key}.message=ignore" for key in (TaskType.reload, ADD_COMPONENT_TASK_NAME, REMOVE_COMPONENT_TASK_NAME)),
)


class ReplayClock(SimClock):
    """Clock that shows the recorded time."""

    def show(self, time_s: float) -> None:
        """Set the time."""
        self._now_s = time_s


def replay_node(
    trace: Trace,
    role: str,
    config: Config,
    tolerances: Sequence[Tolerance] = (),
    before_task: Callable[[int], None] = lambda seq: None,
    on_node: Callable[[Node], None] = lambda node: None,
) -> NodeReplay:
    """Replay one node of a run.

    Args:
        trace: of the run.
        role: of the node.
        config: with the same endpoints, or changed ones; its loops are left out.
        tolerances: differences to accept.
        before_task: called with the seq of each recorded task before it is executed again.
        on_node: called with the node before it begins.

    Raises:
        TraceError: an input of the trace cannot be decoded.
        ConfigError: the config does not have this role.
    """
    name = f"{role}_node"
    records = [record for record in trace.records if getattr(record, "node", None) == name]
    tolerances = [*tolerances, *map(Tolerance.parse, UNCOMPARED)]
    checker = ReplayChecker(name, records, trace.header.commands.get(name, []), tolerances)
    clock = ReplayClock()
    node = Node(role, config, clock=clock, recorder=checker, seed=trace.header.seed, is_replay=True)
    node.is_in_lock_step = trace.header.clock == "sim"
    on_node(node)
    with Watchdog([node]):
        _Driver(node, clock, checker, before_task).run(records)
    checker.result.executed = node.machine.executed
    return checker.result


@dataclass
class _Driver:
    """Driver of a replay: adds the inputs and executes the tasks in the recorded order."""

    node: Node
    clock: ReplayClock
    checker: ReplayChecker
    before_task: Callable[[int], None]

    def run(self, records: Sequence[Record]) -> None:
        self._show(next((record.t for record in records if isinstance(record, BeginRecord)), 0.0))
        try:
            self.node.begin()
        except ComponentFailedError as failure:
            self.checker.check_failure_outside_task(failure, "begin")
            self._end()
            return
        self.checker.report_missing_begins()
        before: Record | None = None
        for record in records:
            if isinstance(record, InputRecord):
                # In lock step an input arrives when the queue is empty, or together with another input.
                if self.node.is_in_lock_step and not isinstance(before, InputRecord):
                    self._finish(record.seq)
                self._show(record.t)
                self.checker.entering = record
                self.node.machine.enqueue_replayed(_input_task(record), record.source)
            elif isinstance(record, Executed):
                if self.checker.was_interrupted(record):
                    break  # it did not return in the recording, and would block the replay
                self._execute(record)
            before = record
        else:
            self._finish(math.inf)
        self._end()

    def _end(self) -> None:
        self.node.machine.discard_queued()
        try:
            self.node.end("replayed")
        except ComponentFailedError as failure:
            self.checker.check_failure_outside_task(failure, "halt")

    def _show(self, time_s: float) -> None:
        self.clock.show(time_s)
        self.node.machine.now_s = time_s

    def _execute(self, record: Executed) -> None:
        """Execute the task of this record, after tasks queued before it that are not in the recording."""
        while (task_ref := self.node.machine.next_task_ref) is not None:
            expected = self.checker.record_of(task_ref)
            if expected is not None and expected.seq > record.seq:
                return  # the recorded task is missing here; already reported when its cause did not return it
            if expected is record:
                self._show(record.t)
                self.before_task(record.seq)
            self._execute_next()
            if expected is record:
                return

    def _finish(self, seq: float) -> None:
        """Execute the tasks recorded before this seq, and those that are not in the recording."""
        while (task_ref := self.node.machine.next_task_ref) is not None:
            expected = self.checker.record_of(task_ref)
            if self.checker.was_unexecuted(task_ref) or (expected is not None and expected.seq > seq):
                return
            self._execute_next()

    def _execute_next(self) -> None:
        try:
            self.node.machine.execute_next()
        except HandlerError as failed:
            error = failed.__cause__
            if error is None or isinstance(error, KeyboardInterrupt):
                raise
            self.checker.check_failure(failed, error)
        else:
            self.checker.report_missing_calls()


def _input_task(record: InputRecord) -> Task:
    try:
        values = decode_value(bytes(record.values), KINDS)
        return Task(TaskType(record.type), record.name, values)
    except (ValueEncodingError, ValueError) as error:
        fix = "loops should store plain data: numbers, text, lists, dicts, numpy arrays."
        if record.name == ADD_COMPONENT_TASK_NAME:
            fix = (
                "let a plain event come from outside, and a handler return tasks.add_component(MyFactory()): "
                "then a replay makes the factory, too."
            )
        raise TraceError(
            f"Input {record.type} '{record.name}' (seq {record.seq}) cannot be brought back: {error}", fix=fix
        ) from error


def reload_sources(trace: Trace) -> dict[int, dict[str, str]]:
    """Return the sha256 of each file that a reload read, by its name and its folder's, by the seq of the reload."""
    return {record.seq: dict(data["sources"]) for record, data in _reloads(trace.records)}


def describe_reloads(trace: Trace, replayed: Sequence[Record]) -> list[str]:
    """Return a sentence for each reload known to have read other code than that at the start of the run.

    Args:
        trace: of the run.
        replayed: records of its replay, with the seqs of the corresponding recorded ones.
    """
    at_first = {PurePosixPath(label).name: sha256 for label, sha256 in trace.header.sources.items()}
    now = {record.seq: data["sources"] for record, data in _reloads(replayed)}
    sentences = []
    for record, data in _reloads(trace.records):
        then = data["sources"]
        other = [file for file, sha256 in then.items() if at_first.get(PurePosixPath(file).name) != sha256]
        if other:
            since = " They have changed again since." if now.get(record.seq, then) != then else ""
            sentences.append(
                f"seq {record.seq}, t = {record.t:.3f} s: '{data['component']}' was reloaded with other "
                f"code than the run began with ({', '.join(other)}). This replay ran the current contents of the files "
                f"from the beginning.{since}"
            )
    return sentences


def _reloads(records: Sequence[Record]) -> Iterator[tuple[TaskRecord, dict[str, Any]]]:
    """Yield the reloads, and the data of the page that each has returned, whether or not it was stored before the end.

    A student's own handler of a reload may return a page of that key, too.
    """
    for record in records:
        if not (isinstance(record, TaskRecord) and record.type == TaskType.reload):
            continue
        for returned in (task for call in record.handled for task in call.returned if task.name == TaskType.reload):
            page = next(iter(decode_value(bytes(returned.values), KINDS)), None)
            if isinstance(page, Page) and isinstance(page.data, dict) and "sources" in page.data:
                yield record, page.data
