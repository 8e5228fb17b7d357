"""A correct queue for lab 11, with which the grader compares a student's. The student's process does not get it."""

from __future__ import annotations

import math

from snr_sim import Task, TaskType


class PlainQueue:
    """A correct queue, implemented the slow way: all tasks in one list, searched at each operation."""

    def __init__(self, max_tasks: int) -> None:
        self._max_tasks = max_tasks
        self._waiting: list[tuple[float, Task]] = []  # priority and task, in the order of arrival

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, task: Task, priority: int) -> Task | None:
        """Let a task in; return the one that has to leave for it, if it is full."""
        self._waiting.append((math.inf if task.type is TaskType.terminate else priority, task))
        if len(self._waiting) <= self._max_tasks:
            return None
        lowest = min(range(len(self._waiting)), key=lambda i: self._waiting[i][0])  # the first of several: the oldest
        return self._waiting.pop(lowest)[1]

    def take(self) -> Task | None:
        """Return the next task, or None."""
        if not self._waiting:
            return None
        return self._waiting.pop(max(range(len(self._waiting)), key=lambda i: self._waiting[i][0]))[1]
