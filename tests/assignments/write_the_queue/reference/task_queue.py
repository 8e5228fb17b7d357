"""The queue of a node: where its tasks wait for their turn."""

from collections import deque
from heapq import heapify, heappop, heappush
from math import inf

from snr_sim import TaskType


class TaskQueue:
    """A line for each priority that is in use, and two heaps that know the highest and the lowest of them."""

    def __init__(self, max_tasks):
        """max_tasks: how many tasks it may hold."""
        self.max_tasks = max_tasks
        self.count = 0
        self.lines = {}
        self.highest = []  # negative: heapq gives the least
        self.lowest = []

    def __len__(self):
        return self.count

    def put(self, task, priority):
        """Lets a task in. Returns the task that has to leave for it, or None if there is room."""
        if task.type is TaskType.terminate:
            priority = inf
        if priority not in self.lines:
            self.lines[priority] = deque()
            heappush(self.highest, -priority)
            heappush(self.lowest, priority)
        self.lines[priority].append(task)
        self.count += 1
        if self.count <= self.max_tasks:
            return None
        while self.lowest[0] not in self.lines:
            heappop(self.lowest)
        return self.first_of(self.lowest[0])

    def take(self):
        """Return the task whose turn it is, which waits no longer; None if none waits."""
        if self.count == 0:
            return None
        while -self.highest[0] not in self.lines:
            heappop(self.highest)
        return self.first_of(-self.highest[0])

    def first_of(self, priority):
        """Return the oldest task of a priority, which waits no longer."""
        line = self.lines[priority]
        task = line.popleft()
        self.count -= 1
        if not line:
            del self.lines[priority]
            self.tidy()
        return task

    def tidy(self):
        """Removes priorities without a task, when they are more than half of a heap."""
        if len(self.highest) + len(self.lowest) > 4 * len(self.lines) + 16:
            self.lowest = list(self.lines)
            self.highest = [-priority for priority in self.lines]
            heapify(self.lowest)
            heapify(self.highest)
