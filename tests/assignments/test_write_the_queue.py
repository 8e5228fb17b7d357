"""The lab "write the queue": its reference gets all points, and each wrong solution loses those of its mistake."""

import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import load_lab
from snr_sim.prelude.errors import SnrError
from snr_sim.scenario.library import load_program
from tests.assignments.mistakes import write_solution
from tests.assignments.write_the_queue.mistakes import MISTAKES

pytestmark = pytest.mark.usefixtures("warm_children")

LAB = Path(__file__).parents[2] / "assignments" / "11_write_the_queue"
_lab = load_lab(LAB / "checks.py")
QueueBench = _lab.module("grader.queue_bench").QueueBench
PlainQueue = _lab.module("grader.plain_queue").PlainQueue
find_forbidden_construct = _lab.module("grader.restricted_code").find_forbidden_construct
REFERENCE = Path(__file__).parent / "write_the_queue" / "reference" / "task_queue.py"


def graded(folder: Path, secret: bytes | None = None) -> Any:
    return grade_submission(load_lab(LAB / "checks.py"), folder, secret, "none")


def lost(result: Any) -> dict[str, float]:
    return {check.name: check.max_points - check.points for check in result.checks if check.points < check.max_points}


def hints(result: Any) -> str:
    return "\n".join(case.hint for check in result.checks for case in check.cases)


def test_reference_gets_all_points_with_hidden_cases() -> None:
    result = graded(REFERENCE.parent, b"secret")
    assert (result.status, result.points, hints(result).strip()) == ("graded", 100.0, "")


@pytest.mark.parametrize("name", MISTAKES)
def test_mistake_loses_its_points_and_gets_its_hint(name: str, tmp_path: Path) -> None:
    result = graded(write_solution(LAB.name, tmp_path, name, starter=False))
    assert result.status == "graded"
    assert lost(result) == MISTAKES[name].lost
    assert MISTAKES[name].hint in hints(result)


def test_unedited_starter_runs_and_gets_hints(tmp_path: Path) -> None:
    shutil.copytree(LAB / "starter", tmp_path, dirs_exist_ok=True)
    done = subprocess.run([sys.executable, tmp_path / "try_it.py"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "with 240 tasks one operation is  121.0 comparisons and moves" in done.stdout
    plain = SimpleNamespace(TaskQueue=PlainQueue)
    page = load_program(str(tmp_path / "try_it.py"))
    assert QueueBench(plain).run_node(page.MAX_TASKS, page.ANSWERS, page.FIRST) == page.RIGHT
    result = graded(tmp_path)
    assert result.points == 15
    assert not [case.error for check in result.checks for case in check.cases if case.error]


def test_commands_of_the_readme_exit_as_stated(type_page: Callable[..., dict[str, str]]) -> None:
    printed = type_page(LAB / "README.md", after={})
    assert any("15 of 100" in output for output in printed.values())


def test_missing_class_or_wrong_result_type_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "task_queue.py"
    for text, message in (
        ("x = 1\n", "no class TaskQueue"),
        ("class TaskQueue:\n    pass\n", "no method put"),
        (REFERENCE.read_text().replace("return task\n", "return task.name\n"), "take() returned 'event"),
    ):
        file.write_text(text)
        result = graded(tmp_path)
        assert result.points == 5  # it is plain
        assert message in result.checks[1].cases[0].error


def test_node_with_endless_queue_raises(tmp_path: Path) -> None:
    file = tmp_path / "task_queue.py"
    file.write_text(
        "class TaskQueue:\n    def __init__(self, max_tasks): self.task = None\n    def __len__(self): return 1\n"
        "    def put(self, task, priority): self.task = task\n    def take(self): return self.task\n"
    )
    bench = QueueBench(load_program(str(file)))
    with pytest.raises(SnrError, match="The node has no end"):
        bench.run_node(5, {}, [["event", "again"]])


@pytest.mark.parametrize("seed", range(20))
def test_reference_results_equal_those_of_the_plain_queue(seed: int) -> None:
    rng = random.Random(seed)
    max_tasks, asked = rng.randrange(1, 9), list[list[Any]]()
    for i in range(300):
        put = ["put", rng.choice(["event", "event", "terminate"]), f"t{i}", rng.randrange(-3, 4)]
        asked.append(rng.choice([put, put, ["take"], ["len"]]))
    plain = SimpleNamespace(TaskQueue=PlainQueue)
    student = QueueBench(load_program(str(REFERENCE)))
    assert student.answers(max_tasks, asked) == QueueBench(plain).answers(max_tasks, asked)


def test_work_count_is_deterministic(tmp_path: Path) -> None:
    def work(text: str, size: int) -> float:
        file = tmp_path / f"queue_{abs(hash(text))}.py"
        file.write_text(text)
        asked: list[list[Any]] = [["put", "event", f"e{i}", i * 31 % 97] for i in range(size)]
        asked += [["take"] if i % 2 else ["put", "event", f"f{i}", i * 37 % 97] for i in range(size)]
        return QueueBench(load_program(str(file))).work(size, asked)

    begin = "class TaskQueue:\n    def __init__(self, max_tasks): self.waiting = []\n    def __len__(self): return 0\n"
    put = "    def put(self, task, priority): self.waiting.append((priority, task))\n"
    front = begin + put + "    def take(self): self.waiting.pop(0)\n"
    scan = begin + put + "    def take(self): min(self.waiting, key=lambda one: one[0]); self.waiting.pop()\n"
    copy = begin + put + "    def take(self): self.waiting = self.waiting[:-1]\n"
    end = begin + put + "    def take(self): self.waiting.pop()\n"
    for slow in (front, scan, copy):
        assert work(slow, 200) > 5 * work(slow, 30)
    assert work(end, 200) < 5
    assert work(end, 200) == work(end, 200)


@pytest.mark.parametrize(
    "place",
    [
        "waiting = []\nclass TaskQueue:\n    def line(self): return waiting\n",
        "class TaskQueue:\n    waiting = []\n    def line(self): return self.waiting\n",
        "class Line(list):\n    def __iter__(self): return iter(())\n    def __len__(self): return 0\n"
        "waiting = Line()\nclass TaskQueue:\n    def line(self): return waiting\n",
        "class Box(int): pass\nbox = Box()\nbox.it = []\nclass TaskQueue:\n    def line(self): return box.it\n",
        "class Slot:\n    __slots__ = ('__it',)\n    def __init__(self): self.__it = []\n"
        "    def get(self): return self.__it\nslot = Slot()\nclass TaskQueue:\n    def line(self): return slot.get()\n",
        "def held(line):\n    while True: yield line\nhold = held([])\nnext(hold)\n"
        "class TaskQueue:\n    def line(self): return next(hold)\n",
        "def kept(line): return lambda: line\nkeep = kept([])\nclass TaskQueue:\n    def line(self): return keep()\n",
        "class TaskQueue:\n    def line(self, it=[]): return it\n",
    ],
)
def test_moves_in_hidden_lists_are_counted(place: str, tmp_path: Path) -> None:
    file = tmp_path / "hidden.py"
    file.write_text(
        f"{place}    def __init__(self, max_tasks): pass\n    def __len__(self): return 0\n"
        "    def put(self, task, priority): self.line().insert(0, task)\n    def take(self): pass\n"
    )
    assert find_forbidden_construct(file.read_text()) == ""
    asked: list[list[Any]] = [["put", "event", f"e{i}", 0] for i in range(100)]
    assert QueueBench(load_program(str(file))).work(50, asked) > 50
