"""Components with given inputs: what they produce from each, in a bare node on a virtual clock."""

from pathlib import Path

import pytest

from snr_sim.grading import Output, Stimulus, Student
from snr_sim.grading.lab.verdicts import SubmissionError

pytestmark = pytest.mark.slow

THREE = """
from snr_sim import Endpoint, Loop, LoopFactory, TaskType, tasks


class Part(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {
            (TaskType.process_data, "depth"): self.on_depth,
            (TaskType.event, "start"): self.on_start,
        }

    def begin(self):
        self.schedule(tasks.event("hello", [self.name]))

    def on_depth(self, task, task_id):
        self.store_data("seen", [self.name, self.get_data("depth"), self.get_time_s(), self.get_age_s("depth")], False)
        return [tasks.event("received", [self.get_data("depth_prev")])]

    def on_start(self, task, task_id):
        self.task_handlers = {(TaskType.process_data, "depth"): self.on_depth_later}
        self.number = self.rng.random()

    def on_depth_later(self, task, task_id):
        return self.store_data_task("late", self.number)


class Ticker(Loop):
    def loop(self):
        self.store_data("tick", self.get_time_s(), process=False)
        if self.get_time_s() > 0.25:
            self.stop()


class TickerFactory(LoopFactory):
    def get(self, parent):
        return Ticker(self, parent, "ticker", 10.0)


def factories(robot):
    made = {"a": Part.factory("a"), "b": Part.factory("b"), "ticker": TickerFactory()}
    return [made[name] for name in robot.options["parts"].split()]
"""


def fed(folder: Path, pages: list[Stimulus], parts: str = "a", **details: object) -> list[Output]:
    (folder / "mine.py").write_text(THREE)
    student = Student(folder)
    return student.run_inputs("mine.py", pages, options={"parts": parts}, **details)


def brief(produced: list[Output]) -> list[tuple[str, str, str, int | None]]:
    return [(one.component, one.kind, one.name, one.after) for one in produced]


def test_outputs_are_returned_in_order_with_their_cause(tmp_path: Path) -> None:
    produced = fed(tmp_path, [Stimulus(0.0, "depth", 1.5), Stimulus(0.5, "other", 0), Stimulus(1.0, "depth", 2.5)])
    assert brief(produced) == [
        ("a", "event", "hello", None),
        ("a", "store_page", "seen", 0),
        ("a", "event", "received", 0),
        ("a", "store_page", "seen", 2),
        ("a", "event", "received", 2),
    ]
    assert [one.value for one in produced] == [["a"], ["a", 1.5, 0.0, 0.0], [None], ["a", 2.5, 1.0, 0.0], [1.5]]
    assert [one.at_s for one in produced] == [0.0, 0.0, 0.0, 1.0, 1.0]


def test_components_run_in_the_requested_order(tmp_path: Path) -> None:
    depth = [Stimulus(0.0, "depth", 1.0)]
    names = [one.component for one in fed(tmp_path, depth, "a b") if one.kind == "store_page"]
    assert names == ["a", "b"]
    names = [one.component for one in fed(tmp_path, depth, "a b", order=[1, 0]) if one.kind == "store_page"]
    assert names == ["b", "a"]
    with pytest.raises(SubmissionError, match="makes 1 components, where 2 were expected"):
        fed(tmp_path, depth, "a", order=[1, 0])


def test_loops_tick_until_stop_or_time_limit(tmp_path: Path) -> None:
    ticks = [one.at_s for one in fed(tmp_path, [Stimulus(0.15, "x", 0)], "ticker")]
    assert ticks == [0.0, 0.1]
    produced = fed(tmp_path, [], "ticker", until_s=9.0)
    assert [one.at_s for one in produced] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert {one.after for one in produced} == {None}


def test_handlers_can_change_and_random_numbers_follow_the_seed(tmp_path: Path) -> None:
    def late(seed: int) -> list[float]:
        start = Stimulus(0.0, task=("event", "start", []))
        produced = fed(tmp_path, [start, Stimulus(1.0, "depth", 1.0), Stimulus(2.0, "depth", 1.0)], seed=seed)
        return [one.value for one in produced if one.name == "late"]

    assert len(late(1)) == 2
    assert late(1) == late(1) != late(2)


CARRIED = """
from dataclasses import dataclass

from snr_sim import Endpoint, TaskType, tasks


@dataclass
class Sum:
    depth_m: float


class Part(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {
            (TaskType.event, "start"): self.on_start,
            (TaskType.process_data, "depth"): self.on_depth,
            (TaskType.process_data, "sum"): self.on_sum,
        }
        self.has_asked = False

    def on_start(self, task, task_id):
        return [self.store_data_task("depth", float(i)) for i in range(5)]

    def on_depth(self, task, task_id):
        assert task.page is self.get_page("depth")
        seen = [task.page.data, self.get_data("depth_prev")]
        again = [] if self.has_asked else ASKED
        self.has_asked = True
        return [self.store_data_task("seen", seen, False), self.store_data_task("sum", Sum(task.page.data)), *again]

    def on_sum(self, task, task_id):
        before = self.get_data("sum_prev")
        seen = [type(task.page.data).__name__, self.get_data("sum").depth_m, before and before.depth_m]
        return self.store_data_task("seen", seen, False)


def factories(robot):
    return [Part.factory()]
"""


def carried(folder: Path, asked: str) -> list[list[object]]:
    (folder / "mine.py").write_text(CARRIED.replace("ASKED", asked))
    with Student(folder) as student:
        produced = student.run_inputs("mine.py", [Stimulus(1.0, task=("event", "start", []))])
    return [one.value for one in produced if one.name == "seen"]


def test_student_handler_gets_the_page_of_its_task(tmp_path: Path) -> None:
    before: list[float | None] = [None, *map(float, range(5))]
    depths = [[float(i), before[i]] for i in range(5)]
    again = [0.0, None]  # behind the first sum
    assert carried(tmp_path, "[task]")[:6] == [*depths, again]
    sums = [one for one in carried(tmp_path, "[]") if one[0] == "Sum"]
    assert sums == [["Sum", float(i), before[i]] for i in range(5)]


def test_process_data_task_with_values_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(SubmissionError, match="'part' made a process_data task that carries values"):
        carried(tmp_path, "[type(task)(task.type, 'depth', [self.page('depth', 9.0)])]")
