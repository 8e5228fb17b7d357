"""Reports of code that does not return, with the student's line: before a run, in a run, and threads that outlive it.

A component that does not return blocks the node's thread, so another thread (`core/watchdog.py`) detects it, and only
reads, from Python's own frames: the run itself spends no time on it. C code that holds the interpreter lock stops that
thread too. Before a run there are no nodes to watch: then `SlowStart` does the same.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from functools import lru_cache
from types import FrameType
from typing import Any, NamedTuple, Self

from snr_sim.core.handlers import describe
from snr_sim.core.interrupts import interrupt_new_code, write_stderr
from snr_sim.core.machine import EventMachine
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.source_location import SourceLocation, after_line, current_location, is_student_file
from snr_sim.prelude.errors import ComponentFailedError, SnrError
from snr_sim.prelude.task import Task

REPORT_AFTER_S = 2.0
REPORT_PERIOD_S = 10.0
WITHOUT_LINE_S = 10.0  # without a line of student code, report later: a device may take seconds to start
SLOW_CHECKS = 10  # consecutive checks that find the same line: the run spends its time there

_FIX = (
    "a handler, and a loop's loop(), does its work once and returns. What is to happen again is a Loop's work, at its "
    "max_tick_rate_hz; what is to happen later, a TimeoutLoopFactory's."
)
START_CHECK_PERIOD_S = 0.5
START_REPORT_AFTER_S = 5.0  # a large package takes some seconds to import

_START_FIX = (
    "what is at the top level of a file, in factories() and in __init__() ends at once. What is to happen again is "
    "a Loop's work, at its max_tick_rate_hz. Ctrl-C ends the program."
)
_POOLS = "concurrent.futures.thread"  # Python ends a pool's idle threads itself
_DEBUGGERS = ("bdb", "pdb")
# The functions that execute a task; it is in their local variable `task`.
_EXECUTING = tuple(function.__code__ for function in (EventMachine.run_ready, EventMachine.execute_next))
_is_student_file = lru_cache(maxsize=1024)(is_student_file)


class CurrentCall(NamedTuple):
    """What a thread is doing.

    Args:
        frame: innermost frame of student code, or None while snr_sim's own code is running.
        function: the student's function that snr_sim has called.
        task: the task that is being executed, if requested.
        executed: number of tasks that the machine has executed in this call and not counted yet, if requested.
        is_debugged: whether a debugger is stepping through it.
    """

    frame: FrameType | None = None
    function: str = ""
    task: Task | None = None
    executed: int = 0
    is_debugged: bool = False

    @property
    def name(self) -> str:
        """The student's function, or file, as text; empty if none runs."""
        return "the file" if self.function == "<module>" else f"{self.function}()" if self.function else ""

    @property
    def line(self) -> tuple[str, int] | None:
        """File and number of the student's line."""
        return None if self.frame is None else (self.frame.f_code.co_filename, self.frame.f_lineno)

    @property
    def location(self) -> SourceLocation | None:
        """The student's line, to be shown."""
        return current_location(self.frame)


def current_call(newest: FrameType | None, base: FrameType | None, with_task: bool = False) -> CurrentCall:
    """Return what a thread is doing.

    Args:
        newest: its newest frame.
        base: the frame in which the run began; frames outside it are ignored.
        with_task: also find task and count. Python 3.11 and 3.12 then keep the values of the machine's local variables
            alive until the machine is idle, so use this only if something seems to be wrong with the run.
    """
    inner: FrameType | None = None
    function, is_debugged = "", False
    found: dict[str, Any] = {}
    frame = newest
    while frame is not None and frame is not base:
        if _is_student_file(frame.f_code.co_filename):
            inner = inner or frame
            function = frame.f_code.co_name
        elif with_task and not found and frame.f_code in _EXECUTING:
            found = frame.f_locals
        is_debugged = is_debugged or frame.f_globals.get("__name__") in _DEBUGGERS
        frame = frame.f_back
    return CurrentCall(inner, function, found.get("task"), found.get("executed", 0), is_debugged)


class Standstill:
    """Standstill check of a run, polled.

    Args:
        nodes: of the run; one thread runs them all.
        call: returns the current call of that thread; with True also the task that it executes.
    """

    def __init__(self, nodes: Sequence[NodeParts], call: Callable[[bool], CurrentCall]) -> None:
        self.stalled_s: float = 0.0  # wall time without any change
        self._nodes = nodes
        self._call = call
        self._state: list[Any] = []
        self._executed = -1  # tasks that the machine has not counted yet; -1 if not read
        self._report_at_s = REPORT_AFTER_S
        self._lines: deque[tuple[str, int] | None] = deque(maxlen=SLOW_CHECKS)
        self._reported_lines: set[tuple[str, int]] = set()

    def check(self, passed_s: float) -> str | None:
        """Return a report if one is due, else None; `passed_s` is the wall time since the last check."""
        state = self._progress()
        is_same = state == self._state
        call = self._call(is_same)
        is_same = is_same and self._executed in (-1, call.executed)
        self._state, self._executed = state, call.executed if is_same else -1
        self._lines.append(call.line if self.running is not None else None)
        if not is_same or call.is_debugged:
            self.stalled_s, self._report_at_s = 0.0, REPORT_AFTER_S
            return self._slow(call)
        self.stalled_s += passed_s
        if self.stalled_s < (self._report_at_s if call.frame is not None else max(self._report_at_s, WITHOUT_LINE_S)):
            return None
        if interrupt_new_code(self.node, f"{self._describe(call)}, and was interrupted.\n  Try: {_FIX}"):
            return None
        self._report_at_s = self.stalled_s + REPORT_PERIOD_S
        if call.line is not None:
            self._reported_lines.add(call.line)
        return f"{self._describe(call)}, and nothing else runs meanwhile.\n  Try: {_FIX} Ctrl-C ends the run in order."

    def failure(self) -> ComponentFailedError:
        """Return the error of a run that is ended for a standstill."""
        running = self.running
        what = f"{self._describe(self._call(True))}: the run was ended."
        return ComponentFailedError(f"{what}\n  Try: {_FIX}", self.node.name, "" if running is None else running.name)

    @property
    def node(self) -> NodeParts:
        """The node that is running a component, or the first."""
        return next((node for node in self._nodes if node.machine.running is not None), self._nodes[0])

    @property
    def running(self) -> Any:
        """The component whose code runs, if one does."""
        return self.node.machine.running

    def _progress(self) -> list[Any]:
        """Return counters that change while a run makes progress. All of them exist anyway."""
        first = self._nodes[0]
        return [
            first.clock.now_s() if first.is_in_lock_step else None,
            *(progress_of(node) for node in self._nodes),
        ]

    def _describe(self, call: CurrentCall) -> str:
        task = "" if call.task is None else f", which handles {describe(call.task.id())},"
        at = f"at t = {self.node.machine.now_s:.3f} s"
        return after_line(call.location, f"{self._who(call)}{task} has not returned for {self.stalled_s:.0f} s {at}")

    def _who(self, call: CurrentCall) -> str:
        if self.running is None:  # then a plant or a scenario runs, which follow the clock
            return call.name or "the run"
        guarded = self.node.machine.guarded_call
        name = self.running.name if guarded is None else guarded.component
        return f"{call.name} of component '{name}'" if call.name else f"component '{name}'"

    def _slow(self, call: CurrentCall) -> str | None:
        """Return, once, a report on a line at which many checks find the run although it makes progress."""
        line = call.line
        if line is None or line in self._reported_lines or list(self._lines) != [line] * SLOW_CHECKS:
            return None
        self._reported_lines.add(line)
        return (
            f"{call.location}\n  {self._who(call)} was in this line whenever the run was looked at, {SLOW_CHECKS} "
            f"times in a row: the run spends its time there.\n  Try: {_FIX} In time.sleep() a whole run waits."
        )


def progress_of(node: NodeParts) -> tuple[Any, ...]:
    """Return counters that change while a node makes progress, also an idle one; from any thread."""
    machine = node.machine
    return id(machine.running), machine.now_s, machine.executed, node.inbox.wait_count, node.is_finished


class SlowStart:
    """Watch of a start, active in a `with` block on the thread and in the function that make it.

    Args:
        now_s, report: the clock and the output, as tests need.
    """

    def __init__(
        self,
        now_s: Callable[[], float] = time.monotonic,
        report: Callable[[str], object] = write_stderr,
    ) -> None:
        self._now_s = now_s
        self._report = report
        self._base: FrameType | None = sys._getframe(1)  # of the caller, which is left out
        self._thread_id = threading.get_ident()
        self._since_s: float | None = None  # when it was first seen in student code
        self._report_after_s = START_REPORT_AFTER_S
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="slow start", daemon=True)

    def __enter__(self) -> Self:
        with suppress(RuntimeError, SnrError):  # as for the watchdog: threads may be forbidden
            self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._is_over.set()
        if self._thread.ident is not None:
            self._thread.join()
        self._base = None  # breaks the reference cycle of that frame and this object

    def check(self) -> None:
        """Report the student's line if its code has been running for too long."""
        call = current_call(sys._current_frames().get(self._thread_id), self._base)
        if call.frame is None or call.is_debugged:
            self._since_s, self._report_after_s = None, START_REPORT_AFTER_S
            return
        now_s = self._now_s()
        self._since_s = now_s if self._since_s is None else self._since_s
        if now_s - self._since_s >= self._report_after_s:
            self._report_after_s += REPORT_PERIOD_S
            self._report(
                f"{call.location}\n  {call.name} has not returned for {now_s - self._since_s:.0f} s, so the run cannot "
                f"begin.\n  Try: {_START_FIX}"
            )

    def _run(self) -> None:
        while not self._is_over.wait(START_CHECK_PERIOD_S):
            self.check()


def notes_on_threads(before: Collection[threading.Thread] = ()) -> list[str]:
    """Return a note on each thread, except those from `before` the run, that keeps the program alive; with its line."""
    frames, notes = sys._current_frames(), []
    for thread in threading.enumerate():
        if thread.daemon or thread is threading.main_thread() or thread in before or thread.ident is None:
            continue
        location = current_location(frames.get(thread.ident))
        if location is None and getattr(getattr(thread, "_target", None), "__module__", "") == _POOLS:
            continue
        where = "" if location is None else f" ({location})"
        notes.append(
            f"Thread '{thread.name}'{where} still runs, and keeps the program alive until it returns. "
            "Start it with daemon=True, and end it in halt()."
        )
    return notes
