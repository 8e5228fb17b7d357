from pathlib import Path

import pytest

from snr_sim.grading.lab.lab import load_lab
from tests.assignments.mistakes import HERE, write_solution
from tests.assignments.write_the_queue.mistakes import MISTAKES

CHECKS = HERE.parents[1] / "assignments" / "11_write_the_queue" / "checks.py"
find_forbidden_construct = load_lab(CHECKS).module("grader.restricted_code").find_forbidden_construct
PLAIN = """
from __future__ import annotations
import heapq
from dataclasses import dataclass, field
from snr_sim import TaskType

@dataclass(order=True)
class Entry:
    priority: float
    number: int
    task: object = field(compare=False)

class TaskQueue:
    __slots__ = ("_heap", "max_tasks")

    def __init__(self, max_tasks):
        super().__init__()
        self.max_tasks, self._heap = max_tasks, []

    def __len__(self):
        return len(self._heap)

    def put(self, task, priority):
        if task.type is TaskType.terminate:
            priority = float("inf")
        try:
            heapq.heappush(self._heap, Entry(-priority, len(self), task))
        except (TypeError, ValueError) as error:
            raise RuntimeError(f"no place for {task.name}") from error

if __name__ == "__main__":
    print(TaskQueue(3))
"""


def test_allowed_constructs_of_a_queue_are_accepted() -> None:
    assert find_forbidden_construct(PLAIN) == ""
    assert find_forbidden_construct("from collections import deque\nwaiting = deque()\n") == ""


CHEATS = {
    "counts_for_itself": "line 3: `sys`",
    "takes_the_kits": "line 3: `importlib`",
    "answers_for_itself": "line 3: `json`",
}


@pytest.mark.parametrize("name", ["", *MISTAKES], ids=lambda name: name or "reference")
def test_only_cheating_solutions_are_rejected(name: str, tmp_path: Path) -> None:
    file = write_solution("11_write_the_queue", tmp_path, name, starter=False) / "task_queue.py"
    assert find_forbidden_construct(file.read_text()) == CHEATS.get(name, "")


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("import gc", "gc"),
        ("def put(task, priority):\n    priority.__class__.compared = 0", "__class__"),
        ("import snr_sim.grading.grade", "snr_sim.grading.grade"),
        ("from snr_sim.grading import grade", "snr_sim.grading.grade"),
        ("from snr_sim import run", "snr_sim.run"),
        ("from . import helper", "None.helper"),
        ("from heapq import *", "heapq.*"),
        ("from collections import _sys", "collections._sys"),
        ("import collections\ncollections._sys", "collections._sys"),
        ("import dataclasses as d\nd.sys", "d.sys"),
        ("import heapq\nmine = heapq", "heapq"),
        ("import heapq\nheapq.heappush = print", "heapq.heappush"),
        ("type(1)", "type"),
        ("kind = type", "type"),
        ("getattr(1, 'real')", "getattr"),
        ("__builtins__", "__builtins__"),
        ("__import__('sys')", "__import__"),
        ("eval('1')", "eval"),
        ("open('x')", "open"),
        ("x = 1 .__class__", "__class__"),
        ("def f():\n    return f.__globals__", "__globals__"),
        ("x = (i for i in [])\nx.gi_frame", "gi_frame"),
        ("try:\n    1 / 0\nexcept Exception as e:\n    e.__traceback__.tb_frame", "__traceback__"),
        ("match 1:\n    case int(__class__=kind): pass", "__class__"),
        ("class Q(list):\n    def __getattribute__(self, name): return 0", "__getattribute__"),
        ("class Q:\n    __dict__ = {}", "__dict__"),
        ("class Q:\n    pass\nQ.__len__ = len", "__len__"),
    ],
)
def test_forbidden_construct_returns_its_line_and_name(line: str, found: str) -> None:
    assert find_forbidden_construct(line) == f"line {line.count(chr(10)) + 1}: `{found}`"


def test_syntax_error_is_rejected() -> None:
    assert find_forbidden_construct("def (") == "it is not Python"
