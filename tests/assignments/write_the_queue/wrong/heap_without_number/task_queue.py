"""One heap of priorities and names: of two tasks with one priority the alphabet decides."""

import heapq
from math import inf

from snr_sim import TaskType


class TaskQueue:
    def __init__(self, most):
        self.most = most
        self.waiting = []
        self.tasks = {}

    def __len__(self):
        return len(self.waiting)

    def put(self, task, priority):
        if task.type is TaskType.terminate:
            priority = inf
        heapq.heappush(self.waiting, (-priority, task.name))
        self.tasks[task.name] = task
        if len(self.waiting) <= self.most:
            return None
        lowest = max(self.waiting)
        self.waiting.remove(lowest)
        heapq.heapify(self.waiting)
        return self.tasks.pop(lowest[1])

    def take(self):
        if not self.waiting:
            return None
        return self.tasks.pop(heapq.heappop(self.waiting)[1])
