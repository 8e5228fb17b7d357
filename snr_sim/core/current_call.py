"""Current call of a run's thread, as another thread sees it: the student's line, the handler and the task.

It is read from Python's own frames, so the run itself spends no time on it.
"""

from __future__ import annotations

from functools import lru_cache
from types import FrameType
from typing import Any, NamedTuple

from snr_sim.core.machine import EventMachine
from snr_sim.core.source_location import SourceLocation, current_location, is_student_file
from snr_sim.prelude.task import Task

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
