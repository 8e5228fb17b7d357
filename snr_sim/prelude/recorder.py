"""The promise of whoever writes down what nodes do, and of the tickets that tie a task to its cause."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeAlias

from snr_sim.prelude.task import Task

# The page that a node gets when its recording fails and it goes on without; any other run has none.
RECORDING_KEY = "recording"

# A queued task of a recorded node, and where it came from: the task, the seq of the record that brought it, its
# position among the tasks of that record, and what the recorder has made of it, so that each is encoded once.
# A plain tuple: there is one for every task, and a named one costs three times as much to make.
Ticket: TypeAlias = tuple[Task, int, int, Any]

# What one handler made of a task: (component's name, handler's name), and the tasks it returned.
Handled: TypeAlias = tuple[tuple[str, str], Sequence[Task]]


class NodeRecorder(Protocol):
    """Takes down one node's part of the trace, on the node's own thread."""

    def begun(self, now_s: float, component: str, scheduled: Sequence[Task]) -> list[Ticket]:
        """Take down what a component scheduled in `begin`; return its tickets, in order."""
        ...

    def input(self, now_s: float, source: str, task: Task) -> Ticket:
        """Take down a task that entered through the door; return its ticket."""
        ...

    def task(self, now_s: float, ticket: Ticket, handled: Sequence[Handled]) -> list[Ticket]:
        """Take down an executed task; return a ticket for each task its handlers returned, in order."""
        ...

    def error(self, now_s: float, component: str, message: str) -> None:
        """Take down what went wrong in a component, just now."""
        ...

    def said(self, now_s: float, component: str, level: str, text: str) -> None:
        """Keep what a component prints or logs, to be taken down after what it does now; from any thread."""
        ...

    def end(self, now_s: float, reason: str, summary: dict[str, Any]) -> None:
        """Take down that the node has ended, and why."""
        ...


class Recorder(Protocol):
    """Writes a run's trace, of one node or several."""

    def for_node(self, name: str) -> NodeRecorder:
        """Return the recorder of one node."""
        ...
