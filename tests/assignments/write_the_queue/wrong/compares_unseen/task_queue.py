"""Looks through all that wait, at each operation, but with numbers that nobody counts."""

from snr_sim import TaskType


class TaskQueue:
    def __init__(self, most):
        self.most = most
        self.number = 0
        self.waiting = {}  # by number of its coming: its priority and itself

    def __len__(self):
        return len(self.waiting)

    def put(self, task, priority):
        self.number += 1
        self.waiting[self.number] = (1e9 if task.type is TaskType.terminate else float(priority), task)
        if len(self.waiting) <= self.most:
            return None
        return self.waiting.pop(min(self.waiting, key=lambda number: (self.waiting[number][0], number)))[1]

    def take(self):
        if not self.waiting:
            return None
        return self.waiting.pop(max(self.waiting, key=lambda number: (self.waiting[number][0], -number)))[1]
