"""Wrong solutions of the lab "write the queue", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace, write

# These use more than a plain queue needs, so no check loads them.
EVERYTHING = {
    "is_plain": 5,
    "keeps_order": 10,
    "urgent_first": 15,
    "terminate_first": 10,
    "is_bounded": 20,
    "forgets": 10,
    "is_quick": 15,
    "drives_a_node": 15,
}

ONE_SORTED_LIST = """\
from bisect import insort
from math import inf

from snr_sim import TaskType


class TaskQueue:
    def __init__(self, max_tasks):
        self.max_tasks = max_tasks
        self.number = 0
        self.waiting = []  # of (priority, minus the number of its coming, task): the next one is last

    def __len__(self):
        return len(self.waiting)

    def put(self, task, priority):
        if task.type is TaskType.terminate:
            priority = inf
        self.number += 1
        insort(self.waiting, (priority, -self.number, task))
        if len(self.waiting) <= self.max_tasks:
            return None
        lowest = self.waiting[0][0]
        i = 0
        while i + 1 < len(self.waiting) and self.waiting[i + 1][0] == lowest:
            i += 1
        return self.waiting.pop(i)[2]

    def take(self):
        return self.waiting.pop()[2] if self.waiting else None
"""
COUNTS_NOTHING = """

bench = sys.modules["snr_sim_lab_11_write_the_queue.grader.queue_bench"]
bench.contents = lambda *roots, **details: {}
"""

MISTAKES = {
    "is_a_stack": Mistake(
        "Takes the newest task of a priority first.",
        lost={"keeps_order": 10, "is_bounded": 20, "drives_a_node": 15},
        hint="that is a stack",
        changes=[
            replace("task_queue.py", "return self.first_of(-self.highest[0])", "return self.last_of(-self.highest[0])"),
            replace(
                "task_queue.py",
                "            heapify(self.highest)\n",
                '''\
            heapify(self.highest)

    def last_of(self, priority):
        """Return the newest task of a priority, which waits no longer."""
        line = self.lines[priority]
        line.rotate(1)
        return self.first_of(priority)
''',
            ),
        ],
    ),
    "heap_without_number": Mistake(
        "Keeps a heap of priorities and names: the alphabet decides between equal priorities.",
        lost={"keeps_order": 10, "is_bounded": 20, "drives_a_node": 15},
        hint="a heap compare names",
        changes=[
            write(
                "task_queue.py",
                """\
import heapq
from math import inf

from snr_sim import TaskType


class TaskQueue:
    def __init__(self, max_tasks):
        self.max_tasks = max_tasks
        self.waiting = []
        self.tasks = {}

    def __len__(self):
        return len(self.waiting)

    def put(self, task, priority):
        if task.type is TaskType.terminate:
            priority = inf
        heapq.heappush(self.waiting, (-priority, task.name))
        self.tasks[task.name] = task
        if len(self.waiting) <= self.max_tasks:
            return None
        lowest = max(self.waiting)
        self.waiting.remove(lowest)
        heapq.heapify(self.waiting)
        return self.tasks.pop(lowest[1])

    def take(self):
        if not self.waiting:
            return None
        return self.tasks.pop(heapq.heappop(self.waiting)[1])
""",
            )
        ],
    ),
    "terminate_waits": Mistake(
        "Treats terminate as a task of the priority that it was given.",
        lost={"terminate_first": 10, "drives_a_node": 15},
        hint="it must leave before all other tasks",
        changes=[
            replace(
                "task_queue.py",
                """\
from math import inf

from snr_sim import TaskType
""",
                "",
            ),
            replace("task_queue.py", "        if task.type is TaskType.terminate:\n            priority = inf\n", ""),
        ],
    ),
    "turns_news_away": Mistake(
        "Rejects the new task when the queue is full and no task of lower priority waits.",
        lost={"is_bounded": 20, "drives_a_node": 15},
        hint="The new task is dropped although",
        changes=[
            replace(
                "task_queue.py",
                "            heappop(self.lowest)\n",
                """\
            heappop(self.lowest)
        line = self.lines[self.lowest[0]]
        line.rotate(1)  # the newest leaves
""",
            )
        ],
    ),
    "drops_silently": Mistake(
        "Drops a task when it is full without returning it.",
        lost={"is_bounded": 20, "drives_a_node": 15},
        hint="and return it to the caller",
        changes=[
            replace(
                "task_queue.py",
                "        return self.first_of(self.lowest[0])\n",
                "        self.first_of(self.lowest[0])\n        return None\n",
            )
        ],
    ),
    "grows_without_end": Mistake(
        "Accepts every task, full or not.",
        lost={"is_bounded": 20, "forgets": 10, "drives_a_node": 15},
        hint="The queue is full, and put()",
        changes=[
            replace(
                "task_queue.py",
                """\
        if self.count <= self.max_tasks:
            return None
        while self.lowest[0] not in self.lines:
            heappop(self.lowest)
        return self.first_of(self.lowest[0])
""",
                "        return None\n",
            )
        ],
    ),
    "leaves_lines_behind": Mistake(
        "Drops tasks, but keeps their priorities.",
        lost={"forgets": 10},
        hint="priorities in a heap without a task",
        changes=[replace("task_queue.py", "            self.tidy()\n", "")],
    ),
    "one_sorted_list": Mistake(
        "Keeps one sorted list: correct, but each new task moves half of the others.",
        lost={"is_quick": 15},
        hint="scan a list",
        changes=[
            write(
                "task_queue.py",
                ONE_SORTED_LIST,
            )
        ],
    ),
    "compares_unseen": Mistake(
        "Searches all tasks in each operation, with comparisons that are not counted.",
        lost={"is_quick": 15},
        hint="an operation scans all of them",
        changes=[
            write(
                "task_queue.py",
                """\
from snr_sim import TaskType


class TaskQueue:
    def __init__(self, max_tasks):
        self.max_tasks = max_tasks
        self.number = 0
        self.waiting = {}  # by number of its coming: its priority and itself

    def __len__(self):
        return len(self.waiting)

    def put(self, task, priority):
        self.number += 1
        self.waiting[self.number] = (1e9 if task.type is TaskType.terminate else float(priority), task)
        if len(self.waiting) <= self.max_tasks:
            return None
        return self.waiting.pop(min(self.waiting, key=lambda number: (self.waiting[number][0], number)))[1]

    def take(self):
        if not self.waiting:
            return None
        return self.waiting.pop(max(self.waiting, key=lambda number: (self.waiting[number][0], -number)))[1]
""",
            )
        ],
    ),
    "counts_for_itself": Mistake(
        "Keeps one sorted list and replaces the function that counts its work.",
        lost=EVERYTHING,
        hint="remove this construct",
        changes=[
            write(
                "task_queue.py",
                '"""A queue."""\n\nimport sys\n\n' + ONE_SORTED_LIST + COUNTS_NOTHING,
            )
        ],
    ),
    "takes_the_kits": Mistake(
        "Imports the queue that the grader compares with.",
        lost=EVERYTHING,
        hint="remove this construct",
        changes=[
            write(
                "task_queue.py",
                '''\
"""A queue."""

import importlib

TaskQueue = importlib.import_module("snr_sim.grading." + "plain_queue").PlainQueue
''',
            )
        ],
    ),
    "answers_for_itself": Mistake(
        "Finds the grader's socket and writes its own answers.",
        lost=EVERYTHING,
        hint="remove this construct",
        changes=[
            write(
                "task_queue.py",
                '''\
"""A queue."""

import json
import os
import stat


class TaskQueue:
    """There is none."""

    def __init__(self, max_tasks):
        """max_tasks: how many tasks it may hold."""


def line():
    """Return the descriptor on which the grader is."""
    for number in range(3, 1000):
        try:
            if stat.S_ISSOCK(os.fstat(number).st_mode):
                return number
        except OSError:
            continue
    return -1


asked = line()
os.write(asked, b'{"n":1,"value":null}\\n')
while True:
    ask = json.loads(os.read(asked, 1 << 20))
    os.write(asked, json.dumps({"n": ask["n"], "value": 0}).encode() + b"\\n")
''',
            )
        ],
    ),
}
