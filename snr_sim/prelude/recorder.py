"""Interface of recorders of nodes, and of the references that link a task to its cause."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeAlias

from snr_sim.prelude.task import Task

# The page that a node gets when its recording fails and the run continues without it; other runs do not have it.
RECORDING_KEY = "recording"

# A queued task of a recorded node, and its origin: the task, the seq of the record that contains it, its
# position among the tasks of that record, and the recorder's encoding of it, so that each is encoded once.
# A plain tuple: there is one for every task, and a named one costs three times as much to make.
TaskRef: TypeAlias = tuple[Task, int, int, Any]

# Result of one handler for a task: (component's name, handler's name), and the tasks it returned.
Handled: TypeAlias = tuple[tuple[str, str], Sequence[Task]]


class NodeRecorder(Protocol):
    """Records one node's part of the trace, on the node's own thread."""

    def begun(self, now_s: float, component: str, scheduled: Sequence[Task]) -> list[TaskRef]:
        """Record the tasks that a component scheduled in `begin`; return their references, in order."""

    def input(self, now_s: float, source: str, task: Task) -> TaskRef:
        """Record a task that arrived through the inbox; return its reference."""

    def task(self, now_s: float, task_ref: TaskRef, handled: Sequence[Handled]) -> list[TaskRef]:
        """Record an executed task; return a reference for each task its handlers returned, in order."""

    def error(self, now_s: float, component: str, message: str) -> None:
        """Record an error of a component, at the current time."""

    def record_text(self, now_s: float, component: str, level: str, text: str) -> None:
        """Keep text that a component prints or logs, to be recorded after its current step; from any thread."""

    def end(self, now_s: float, reason: str, summary: dict[str, Any]) -> None:
        """Record that the node has ended, and why."""


class Recorder(Protocol):
    """Writes a run's trace, of one node or several."""

    def for_node(self, name: str) -> NodeRecorder:
        """Return the recorder of one node."""
