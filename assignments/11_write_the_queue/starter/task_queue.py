"""The queue of a node: where its tasks wait for their turn."""

from snr_sim import TaskType


class TaskQueue:
    """Tasks in the order of their priorities; those of one priority in the order in which they came."""

    def __init__(self, max_tasks):
        """max_tasks: how many tasks it may hold."""
        self.max_tasks = max_tasks
        self.waiting = []

    def __len__(self):
        return len(self.waiting)

    def put(self, task, priority):
        """Lets a task in. Returns the task that has to leave for it, or None if there is room."""
        # Terminate goes before all others: task.type is TaskType.terminate.
        self.waiting.append(task)

    def take(self):
        """Return the task whose turn it is, which waits no longer; None if none waits."""
        return self.waiting.pop(0) if self.waiting else None
