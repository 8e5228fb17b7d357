"""The promise of whoever writes down what a node does, and of the tickets that tie a task to its cause."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from snr_sim.prelude.task import Task


class Ticket(NamedTuple):
    """Where a queued task came from.

    Args:
        cause: seq of the record that brought it; 0 for what components schedule in `begin`.
        nth: position among the tasks of that record.
        values: its values, already encoded, so that each is encoded once.
    """

    cause: int
    nth: int
    values: bytes


class Handled(NamedTuple):
    """What one handler made of a task."""

    component: str
    handler: str
    returned: Sequence[Task]


class Recorder(Protocol):
    """Writes the trace. The node calls it on its own thread, once per input and once per executed task."""

    def begun(self, node: str, now_s: float, component: str, scheduled: Sequence[Task]) -> list[Ticket]:
        """Takes down what a component scheduled in `begin`."""
        ...

    def input(self, node: str, now_s: float, source: str, task: Task) -> Ticket:
        """Takes down a task that entered through the door."""
        ...

    def task(self, node: str, now_s: float, task: Task, ticket: Ticket, handled: Sequence[Handled]) -> list[Ticket]:
        """Takes down an executed task; returns a ticket for each task its handlers returned, in order."""
        ...

    def error(self, node: str, now_s: float, cause: int, component: str, message: str) -> None:
        """Takes down what went wrong."""
        ...

    def end(self, node: str, now_s: float, reason: str, summary: dict[str, Any]) -> None:
        """Takes down that the node has ended, and why."""
        ...
