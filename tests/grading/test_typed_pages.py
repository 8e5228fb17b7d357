"""Pages that hold a dataclass or a Struct, in a graded program: read as objects in it, and as fields outside."""

from pathlib import Path

import pytest

from snr_sim.grading import Stimulus, Student
from snr_sim.grading.lab.verdicts import SubmissionError
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

pytestmark = pytest.mark.slow

TYPED = """
from dataclasses import dataclass

import msgspec
from snr_sim import Endpoint, TaskType


@dataclass
class Seen:
    depth_m: float
    around_m: list[float]


class Wanted(msgspec.Struct):
    seen: Seen
    goal_m: float = 2.0


class Looks(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {
            (TaskType.process_data, "depth"): self.on_depth,
            (TaskType.process_data, "wanted"): self.on_wanted,
        }

    def on_depth(self, task, task_id):
        depth_m = self.get_data("depth")
        return [self.store_data_task("wanted", Wanted(Seen(depth_m, [depth_m, float("nan")])))]

    def on_wanted(self, task, task_id):
        wanted, before = self.get_data("wanted"), self.get_data("wanted_prev")
        was_m = before.seen.depth_m if before is not None else None
        return self.store_data_task("difference", [type(wanted).__name__, wanted.goal_m - wanted.seen.depth_m, was_m])


def factories(robot):
    return [Looks.factory()]
"""


def fed(text: str, folder: Path) -> list[tuple[str, object]]:
    (folder / "mine.py").write_text(text)
    with Student(folder) as student:
        made = student.run_inputs("mine.py", [Stimulus(0.1 * i, "depth", float(i)) for i in (1, 2)])
    return [(one.name, one.value) for one in made if one.kind == "store_page"]


def test_typed_page_is_fields_outside_and_object_inside(tmp_path: Path) -> None:
    made = fed(TYPED.replace('float("nan")', "0.5"), tmp_path)
    assert [value for name, value in made if name == "wanted"] == [
        {"seen": {"depth_m": depth_m, "around_m": [depth_m, 0.5]}, "goal_m": 2.0} for depth_m in (1.0, 2.0)
    ]
    assert [value for name, value in made if name == "difference"] == [["Wanted", 1.0, None], ["Wanted", 0.0, 1.0]]


def test_typed_page_with_nan_returns_the_stored_object(tmp_path: Path) -> None:
    made = fed(TYPED.replace("[depth_m, float", "[float"), tmp_path)
    assert [value for name, value in made if name == "difference"] == [["Wanted", 1.0, None], ["Wanted", 0.0, 1.0]]


def test_page_object_without_fields_raises_with_its_class(tmp_path: Path) -> None:
    plain = TYPED.replace("Wanted(Seen(", "Box((").replace("class Looks(", "class Box:\n    pass\n\n\nclass Looks(")
    plain = plain.replace('Box((depth_m, [depth_m, float("nan")]))', "Box()")
    with pytest.raises(SubmissionError, match=r"value was an object of class .*Box, which cannot be brought back"):
        fed(plain, tmp_path)


def test_typed_command_in_a_graded_run_equals_a_plain_run(tmp_path: Path) -> None:
    text = """
from snr_sim import Endpoint, TaskType
from snr_sim.prelude.signals import EngineCommand


class Burns(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task, task_id):
        return self.store_data_task("engine", EngineCommand(throttle=0.5))


def factories(robot):
    return [Burns.factory()]
"""
    (tmp_path / "mine.py").write_text(text)
    simulation = prepare(Request("lander_vertical", seed=1, controller=str(tmp_path / "mine.py")))
    plant = simulation.plant()
    alone = SimulationRun(simulation, plant, simulation.config(plant)).run()
    with Student(tmp_path) as student:
        graded = student.run_scenario("lander_vertical", 1, "mine.py")
    assert graded.pages("engine")[0][1]["throttle"] == 0.5
    assert (graded.outcome, graded.metrics) == (alone.outcome, alone.metrics)
