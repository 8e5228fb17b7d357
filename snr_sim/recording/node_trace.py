"""One node's part of the trace: its inputs, and every task it executes, as records."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol

import msgspec
from msgspec import Raw

from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.recorder import Handled, TaskRef
from snr_sim.prelude.task import Page, Task, TaskType
from snr_sim.prelude.values import TAG, encode_value
from snr_sim.recording.records import (
    MAX_LOG_LINE_CHARS,
    MAX_LOG_LINES,
    BeginRecord,
    EndRecord,
    ErrorRecord,
    HandlerCall,
    InputRecord,
    LogLineRecord,
    PageLine,
    RepeatLine,
    ReturnedTask,
    TaskLine,
)
from snr_sim.recording.references import CORE_STORES

_encode = msgspec.json.Encoder().encode
_NO_VALUES = b"[]"
MAX_PRINT_CHARS = 100_000  # characters of one `print`
_PROCESS_DATA = TaskType.process_data
_STORE_PAGE = TaskType.store_page  # looked up once: in Python 3.11 a member of an Enum takes 0.1 us to find


class RecordSink(Protocol):
    """Receiver of the records of all nodes of a run, in one order: `TraceWriter`."""

    seq: int  # of the newest record

    def put(self, now_s: float, line: bytes) -> None:
        """Add a line to the trace."""

    def find_repeat(self, key: str, values: bytes, seq: int, index: int) -> tuple[int, int] | None:
        """Return seq and index of an earlier task that carries the same page, and remember this one."""


class NodeTrace:
    """Writer of one node's records. Implements `NodeRecorder`."""

    def __init__(self, writer: RecordSink, node: str) -> None:
        self._writer = writer
        self._node = node
        self._newest = 0  # seq of this node's newest record
        self._pending_output: deque[tuple[float, str, str, str]] = deque()  # when, component, level, text
        self._partial_lines: dict[tuple[str, str], str] = {}  # since its last line end, by component and level
        self._log_line_count = 0

    def begun(self, now_s: float, component: str, scheduled: Sequence[Task]) -> list[TaskRef]:
        """Record what a component scheduled in `begin`."""
        seq = self._next_seq()
        task_refs: list[TaskRef] = []
        returned = self._encode_tasks(scheduled, seq, now_s, task_refs)
        self._writer.put(now_s, _encode(BeginRecord(seq, now_s, self._node, component, returned)))
        self._write_output(now_s)
        return task_refs

    def input(self, now_s: float, source: str, task: Task) -> TaskRef:
        """Record a task that arrived in the inbox."""
        if self._pending_output:
            self._write_output(now_s)
        writer = self._writer
        self._newest = writer.seq = seq = writer.seq + 1
        kind, name, values = _record_form(task)
        line: InputRecord | RepeatLine
        place = writer.find_repeat(name, values, seq, 0) if kind == _STORE_PAGE else None
        if place is None:
            line = InputRecord(seq, now_s, self._node, source, kind, name, Raw(values))
        else:
            line = RepeatLine(seq, now_s, self._node, source, *place)
        writer.put(now_s, _encode(line))
        return (task, seq, 0, now_s)

    def task(self, now_s: float, task_ref: TaskRef, handled: Sequence[Handled]) -> list[TaskRef]:
        """Record an executed task; return a ticket for each task its handlers returned, in order."""
        writer = self._writer
        self._newest = writer.seq = seq = writer.seq + 1
        task, cause, index, cause_s = task_ref
        task_refs: list[TaskRef] = []
        time_s = msgspec.UNSET if cause_s == now_s else now_s
        is_page = task.type is _STORE_PAGE
        process = process_of(task, handled) if is_page else None
        if process is not None:
            task_refs = [(one, seq, 0, now_s) for one in handled[0][1]]
            handled = handled[1:]
        by = [HandlerCall(*label, self._encode_tasks(outputs, seq, now_s, task_refs)) for label, outputs in handled]
        line = PageLine(seq, cause, index, time_s, process, by) if is_page else TaskLine(seq, cause, index, time_s, by)
        writer.put(now_s, _encode(line))
        if self._pending_output:
            self._write_output(now_s)
        return task_refs

    def record_text(self, now_s: float, component: str, level: str, text: str) -> None:
        """Buffer what a component prints or logs until its task is recorded; thread-safe.

        Output before the node's first record, such as while components are created, is not recorded.
        """
        if self._newest and self._log_line_count <= MAX_LOG_LINES and len(self._pending_output) < 4 * MAX_LOG_LINES:
            self._pending_output.append((now_s, component, level, text[:MAX_PRINT_CHARS]))

    def _write_output(self, now_s: float, is_end: bool = False) -> None:
        """Record the buffered output, line by line."""
        while self._pending_output:
            output_s, component, level, text = self._pending_output.popleft()
            *lines, rest = (self._partial_lines.pop((component, level), "") + text).split("\n")
            if rest:
                self._partial_lines[component, level] = rest[:MAX_LOG_LINE_CHARS]
            for line in lines:
                self._write_line(output_s, component, level, line)
        if is_end:
            for (component, level), line in self._partial_lines.items():
                self._write_line(now_s, component, level, line)

    def _write_line(self, now_s: float, component: str, level: str, line: str) -> None:
        self._log_line_count += 1
        if self._log_line_count > MAX_LOG_LINES + 1:
            return
        if self._log_line_count > MAX_LOG_LINES:
            level, line = "WARNING", f"what is printed and logged after {MAX_LOG_LINES} lines is not recorded"
        text = line[:MAX_LOG_LINE_CHARS].encode(errors="backslashreplace").decode()
        cause = self._newest
        record = LogLineRecord(self._next_seq(), now_s, self._node, cause, component, level, text)
        self._writer.put(now_s, _encode(record))

    def error(self, now_s: float, component: str, message: str) -> None:
        """Record a failure in a component, at this moment."""
        cause = self._newest
        self._writer.put(now_s, _encode(ErrorRecord(self._next_seq(), now_s, self._node, cause, component, message)))

    def end(self, now_s: float, reason: str, summary: dict[str, Any]) -> None:
        """Record that the node has ended, and why."""
        self._write_output(now_s, is_end=True)
        self._writer.put(now_s, _encode(EndRecord(self._next_seq(), now_s, self._node, reason, summary)))

    def _next_seq(self) -> int:
        self._newest = self._writer.seq = self._writer.seq + 1
        return self._newest

    def _encode_tasks(
        self, tasks: Sequence[Task], seq: int, now_s: float, task_refs: list[TaskRef]
    ) -> list[ReturnedTask]:
        """Return tasks in their record form, and add a ticket for each."""
        returned = []
        for task in tasks:
            kind, name, values = _record_form(task)
            if kind == _STORE_PAGE:
                self._writer.find_repeat(name, values, seq, len(task_refs))
            task_refs.append((task, seq, len(task_refs), now_s))
            returned.append(ReturnedTask(kind, name, Raw(values)))
        return returned


def process_of(task: Task, handled: Sequence[Handled]) -> bool | None:
    """Return whether the node stored a page and scheduled its `process_data`, or None if it did something else."""
    if not handled or handled[0][0] != CORE_STORES:
        return None
    outputs = handled[0][1]
    if not outputs:
        return False
    is_usual = len(outputs) == 1 and outputs[0].type is _PROCESS_DATA and outputs[0].name == task.name
    # Compare identity: then the values are those of the page's task and are not written again.
    return True if is_usual and len(task.val_list) == 1 and outputs[0].page is task.page else None


def encode_task(task: Task) -> ReturnedTask:
    """Return the record form of a task."""
    kind, name, values = _record_form(task)
    return ReturnedTask(kind, name, Raw(values))


def _record_form(task: Task) -> tuple[str, str, bytes]:
    """Return type, name and values; invalid types and names as text, since the node reports that error later."""
    kind: Any = task.type
    name: Any = task.name
    if not (isinstance(kind, str) and isinstance(name, str)):
        kind, name = str(kind), str(name)
    return kind, name, _encode_values(task)


def _encode_values(task: Task) -> bytes:
    """Return the JSON of the list of values a task carries."""
    values = task.val_list
    if not values:
        return _NO_VALUES
    try:
        if len(values) == 1 and type(values[0]) is Page:
            return b"[" + values[0].serialize() + b"]"
        return encode_value(list(values))
    except Exception as error:  # it contains itself, or cannot be inspected; the run continues all the same
        reason = error.message if isinstance(error, SnrError) else f"{type(error).__name__}: {error}"
        return encode_value([{TAG: "object", "type": "not recorded", "fields": {"because": reason}}])
