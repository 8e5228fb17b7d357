"""Conversion of trace lines to whole records: a line refers to earlier ones instead of repeating them."""

from __future__ import annotations

import msgspec

from snr_sim.core.component import CORE_NAME
from snr_sim.recording.records import (
    BeginRecord,
    HandlerCall,
    InputRecord,
    Line,
    PageLine,
    PageRecord,
    Record,
    RepeatLine,
    ReturnedTask,
    TaskLine,
    TaskRecord,
)

# How many records back an input may repeat a task. It bounds what a listener has to keep in memory.
REPEAT_WITHIN = 500
CORE_STORES: tuple[str, str] = (CORE_NAME, "store")  # component and handler that `PageLine.process` stands for


class References:
    """State of reading a trace in order: what later lines may refer to."""

    def __init__(self) -> None:
        # By cause and nth: node and time of the cause, and the task.
        self._waiting: dict[tuple[int, int], tuple[str, float, ReturnedTask]] = {}  # not executed yet
        self._recent: dict[tuple[int, int], ReturnedTask] = {}

    def resolve(self, line: Line) -> Record:
        """Return the record that a line encodes.

        Raises:
            LookupError: it refers to a task that no earlier line contains, or that was already executed.
        """
        if isinstance(line, (TaskLine, PageLine)):
            return self._resolve_executed(line)
        if isinstance(line, RepeatLine):
            line = self._resolve_repeat(line)
        if isinstance(line, InputRecord):
            self._add_tasks(line.seq, line.node, line.t, [ReturnedTask(line.type, line.name, line.values)])
        elif isinstance(line, BeginRecord):
            self._add_tasks(line.seq, line.node, line.t, line.returned)
        return line

    def _resolve_executed(self, line: TaskLine | PageLine) -> Record:
        try:
            node, cause_s, task = self._waiting.pop((line.cause, line.index))
        except KeyError:
            raise self._unknown_reference(line.seq, line.cause, line.index) from None
        time_s = cause_s if line.t is msgspec.UNSET else line.t
        handled = line.handled
        if isinstance(line, PageLine) and line.process is not None:
            returned = [ReturnedTask("process_data", task.name, task.values)] if line.process else []
            handled = [HandlerCall(*CORE_STORES, returned), *handled]
        self._add_tasks(line.seq, node, time_s, [one for by in handled for one in by.returned])
        kind = PageRecord if isinstance(line, PageLine) else TaskRecord
        return kind(line.seq, time_s, node, task.type, task.name, task.values, line.cause, line.index, handled)

    def _resolve_repeat(self, line: RepeatLine) -> InputRecord:
        task = self._recent.get((line.cause, line.index))
        if task is None:
            raise self._unknown_reference(line.seq, line.cause, line.index)
        return InputRecord(line.seq, line.t, line.node, line.source, task.type, task.name, task.values)

    def _add_tasks(self, seq: int, node: str, time_s: float, tasks: list[ReturnedTask]) -> None:
        for index, task in enumerate(tasks):
            self._waiting[seq, index] = (node, time_s, task)
            self._recent[seq, index] = task
        if len(self._recent) > 4 * REPEAT_WITHIN:
            self._recent = {place: task for place, task in self._recent.items() if place[0] >= seq - REPEAT_WITHIN}

    @staticmethod
    def _unknown_reference(seq: int, cause: int, index: int) -> LookupError:
        if cause >= seq:
            return LookupError(f"the cause of record {seq} does not come before it")
        return LookupError(f"record {seq} refers to task {index} of record {cause}, which is not there or was executed")
