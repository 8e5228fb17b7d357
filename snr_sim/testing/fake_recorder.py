"""Fake recorder that keeps every call in lists, for tests that check what a trace would contain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from snr_sim.prelude.recorder import Handled, TaskRef
from snr_sim.prelude.task import Task


class FakeRecorder:
    """Recorder in memory. Implements `Recorder`, and `NodeRecorder` for each node.

    After a run: `inputs` as (source, task), `handled` as (task, what each handler returned), `errors`,
    `texts`, `ends`.
    """

    def __init__(self) -> None:
        self.inputs: list[tuple[str, Task]] = []
        self.begun_by: list[tuple[str, Sequence[Task]]] = []
        self.handled: list[tuple[Task, list[Handled]]] = []
        self.causes: list[int] = []  # of each handled task: the number of the record that caused it
        self.errors: list[tuple[str, str]] = []
        self.texts: list[tuple[str, str, str]] = []
        self.ends: list[tuple[str, dict[str, Any]]] = []
        self._seq = 0

    def for_node(self, name: str) -> FakeRecorder:
        """Return itself: one list for all nodes."""
        return self

    def begun(self, now_s: float, component: str, scheduled: Sequence[Task]) -> list[TaskRef]:
        """Keep what a component scheduled in `begin`."""
        self.begun_by.append((component, scheduled))
        return self._task_refs(scheduled)

    def input(self, now_s: float, source: str, task: Task) -> TaskRef:
        """Keep a task that entered."""
        self.inputs.append((source, task))
        return self._task_refs([task])[0]

    def task(self, now_s: float, task_ref: TaskRef, handled: Sequence[Handled]) -> list[TaskRef]:
        """Keep an executed task."""
        self.handled.append((task_ref[0], list(handled)))
        self.causes.append(task_ref[1])
        return self._task_refs([task for _, returned in handled for task in returned])

    def error(self, now_s: float, component: str, message: str) -> None:
        """Keep the error."""
        self.errors.append((component, message))

    def record_text(self, now_s: float, component: str, level: str, text: str) -> None:
        """Keep the text that a component logs or prints."""
        self.texts.append((component, level, text))

    def end(self, now_s: float, reason: str, summary: dict[str, Any]) -> None:
        """Keep why a node ended."""
        self.ends.append((reason, summary))

    def _task_refs(self, made: Sequence[Task]) -> list[TaskRef]:
        self._seq += 1
        return [(task, self._seq, index, b"") for index, task in enumerate(made)]
