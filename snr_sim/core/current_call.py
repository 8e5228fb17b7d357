"""What the thread of a run is doing now, as another thread sees it: the student's line, the handler and the task.

It is read from Python's own frames, so the run keeps no account of it.
"""

from __future__ import annotations

from functools import lru_cache
from types import FrameType
from typing import Any, NamedTuple

from snr_sim.core.blame import Place, is_student_file, place_now
from snr_sim.core.machine import EventMachine
from snr_sim.prelude.task import Task

_DEBUGGERS = ("bdb", "pdb")
# The functions in which a task is executed; it is in their local variable `task`.
_EXECUTING = tuple(function.__code__ for function in (EventMachine.run_ready, EventMachine.execute_next))
_is_student_file = lru_cache(maxsize=1024)(is_student_file)


class CurrentCall(NamedTuple):
    """What a thread is doing.

    Args:
        frame: the student's innermost, or None: then the kit's own code is running.
        function: the student's that the kit has called.
        task: that is being executed, if it was asked for.
        executed: how many tasks the machine has executed in this go and not counted yet, if that was asked for.
        is_debugged: somebody is stepping through it.
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
    def place(self) -> Place | None:
        """The student's line, to be shown."""
        return None if self.frame is None else place_now(self.frame)


def current_call(newest: FrameType | None, base: FrameType | None, with_task: bool = False) -> CurrentCall:
    """Return what a thread is doing.

    Args:
        newest: its newest frame.
        base: the one in which the run began; what is further out is not looked at.
        with_task: look for task and count, too. Python 3.11 and 3.12 then keep what the machine's local variables hold
            until it has no more to do, so this is for a run in which something seems to be wrong.
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
