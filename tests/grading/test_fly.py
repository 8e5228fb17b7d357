"""A run with the student's components in a process of their own equals that of `snr run`."""

import shutil
from pathlib import Path

import pytest

from snr_sim.grading.lab.student import Student
from snr_sim.grading.lab.verdicts import LabFault
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import SaidRecord
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.flight import fly_recorded
from snr_sim.scenario.simulation import Request, prepare

pytestmark = pytest.mark.slow

ROBOTS = Path(__file__).parents[2] / "robots"
SCENARIOS = Path(__file__).parents[2] / "scenarios"
SHORT = """
def verdict(plant: Watched) -> Verdict | None:
    return Verdict("over", True) if plant.time_s > 5.0 else None

def metrics(plant: Watched, seed: int) -> dict[str, Any]:
    return {}
"""


def digest_of_run(folder: Path, request: Request) -> str:
    """The digest of a run without a grader."""
    fly_recorded(prepare(request), folder / FILE_NAME)
    return read_trace(folder / FILE_NAME).digest


# Everything that a component may do, in one controller: loops that stop and set their time, life cycle steps, random
# numbers, arrays, handlers that change, pages never stored, two that handle one task, further scheduled tasks.
EVERYTHING = """
import numpy as np
from beside import GAIN
from snr_sim import Endpoint, EndpointFactory, Loop, LoopFactory, Page, Task, TaskType, tasks

def factories(robot):
    return [PartFactory("one"), TickFactory(), PartFactory("two")]

class PartFactory(EndpointFactory):
    def __init__(self, name):
        super().__init__()
        self.name = name

    def get(self, parent):
        return Part(self, parent, self.name)

class Part(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar, TaskType.event: self.on_event}

    def begin(self):
        self.schedule(tasks.event("begun", [self.name]))

    def on_event(self, task, task_id):
        self.get_data("never_stored")
        if task.name == "tick" and task.val_list[0] == 5:
            self.task_handlers[TaskType.process_data, "engine"] = self.on_engine

    def on_engine(self, task, task_id):
        return self.store_data_task(f"heard_{self.name}", self.get_data("engine_prev"), process=False)

    def on_radar(self, task, task_id):
        self.store_data(f"age_{self.name}", (self.get_age_s("radar"), self.get_age_s("nothing")), process=False)
        if self.name == "two":
            return None
        noise = self.rng.random(3)
        self.log.info("noise")
        print("a line", end="")
        print(" in two")
        command = {"throttle": float(GAIN * abs(noise[0]))}
        return [tasks.event("drawn", [noise, np.float32(0.1)]), self.store_data_task("engine", command)]

    def halt(self):
        self.schedule(tasks.event("too_late"))

class TickFactory(LoopFactory):
    def get(self, parent):
        return Tick(self, parent, "tick", 7.0)

class Tick(Loop):
    def setup(self):
        self.count = 0

    def loop(self):
        self.count += 1
        self.schedule([tasks.event("tick", [self.count]), tasks.event("drawn", [self.rng.random()])])
        self.store_data("tick", Page("inside", self.count, "me", 0.0))
        if self.count > 20:
            self.next_tick_at_s = self.get_time_s() + 0.031
        if self.count > 40:
            self.stop()
"""


def test_whatever_a_component_does_it_does_alike_in_a_flight(tmp_path: Path) -> None:
    submission = tmp_path / "submission"
    submission.mkdir()
    (submission / "everything.py").write_text(EVERYTHING)
    (submission / "beside.py").write_text("GAIN = 0.5\n")
    flown = Student(submission, record_to=tmp_path / "runs").fly("lander_vertical", 11, "everything.py")
    assert flown.folder is not None
    run = Request("lander_vertical", seed=11, controller=str(submission / "everything.py"))
    assert flown.trace.digest == digest_of_run(tmp_path, run)
    said = {(one.component, one.level, one.text) for one in flown.trace.records if isinstance(one, SaidRecord)}
    assert said == {("one", "INFO", "noise"), ("one", "PRINT", "a line in two")}
    assert len(flown.pages("tick")) == 41
    assert len(flown.pages("heard_two")) > 5
    assert any("never_stored" in note for note in flown.notes)
    assert any("too_late" in note for note in flown.notes)
    assert flown.truth()[0][1]["poses"]


def test_what_a_component_scheduled_before_it_failed_is_put_down_to_no_other(tmp_path: Path) -> None:
    fails = 'self.schedule(tasks.event("begun"))\n        if self.name == "two": raise ValueError'
    begins = 'self.schedule(tasks.event("begun", [self.name]))'
    assert begins in EVERYTHING
    (tmp_path / "everything.py").write_text(EVERYTHING.replace(begins, fails))
    (tmp_path / "beside.py").write_text("GAIN = 0.5\n")
    run = fly_recorded(
        prepare(Request("lander_vertical", seed=11, controller=str(tmp_path / "everything.py"))), tmp_path / FILE_NAME
    )
    flown = Student(tmp_path).fly("lander_vertical", 11, "everything.py", may_fail=True)
    assert "ValueError" in flown.error
    assert flown.notes == run.notes


@pytest.mark.parametrize(
    ("scenario", "controller"),
    [
        ("lander_vertical", "lander/controllers/coast.py"),
        ("lander_vertical", "lander/controllers/optimal.py"),
        ("lander_pad", "lander/controllers/pad.py"),
        ("urov_depth_hold", "urov/controllers/holds.py"),
    ],
)
def test_a_flight_has_the_same_trace_as_a_run_to_the_last_bit(scenario: str, controller: str, tmp_path: Path) -> None:
    if scenario.startswith("urov"):  # the first seconds are enough: it is armed, and the link is up
        text = (SCENARIOS / f"{scenario}.py").read_text() + SHORT
        scenario = str(tmp_path / "urov_short.py")
        Path(scenario).write_text(text)
    submission = tmp_path / "submission"
    submission.mkdir()
    file = Path(shutil.copy(ROBOTS / controller, submission)).name
    flown = Student(submission, record_to=tmp_path / "runs").fly(scenario, 3, file)
    assert flown.folder is not None
    digest = read_trace(flown.folder / FILE_NAME).digest
    assert digest == digest_of_run(tmp_path, Request(scenario, seed=3, controller=str(submission / file)))


def test_a_flight_that_the_program_ends_with_an_error_may_be_looked_at(tmp_path: Path) -> None:
    raises = (
        (ROBOTS / "lander" / "controllers" / "coast.py")
        .read_text()
        .replace("command:", "assert not self.get_data('radar_prev')\n        command:")
    )
    (tmp_path / "mine.py").write_text(raises)
    flown = Student(tmp_path).fly("lander_vertical", 3, "mine.py", may_fail=True)
    assert (flown.outcome, flown.success, flown.folder) == ("error", False, None)
    assert flown.error.startswith("mine.py, line ")
    assert len(flown.pages("radar")) == 2


def test_a_scenario_that_fails_is_no_fault_of_the_students(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text((ROBOTS / "lander" / "controllers" / "coast.py").read_text())
    broken = tmp_path / "broken.py"
    broken.write_text((SCENARIOS / "lander_vertical.py").read_text() + "\n\ndef verdict(plant):\n    return 1 / 0\n")
    with pytest.raises(LabFault, match="ZeroDivisionError"):
        Student(tmp_path).fly(str(broken), 3, "mine.py")


def test_what_factories_gets_must_be_of_classes_that_the_students_process_can_know(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text((ROBOTS / "lander" / "controllers" / "coast.py").read_text())
    scenario = tmp_path / "own.py"
    own = """
usual = parameters

class Own(LanderParameters):
    pass

def parameters(seed):
    own = Own.__new__(Own)
    own.__dict__.update(vars(usual(seed)))
    return own
"""
    scenario.write_text((SCENARIOS / "lander_vertical.py").read_text() + own)
    with pytest.raises(LabFault, match="define such classes in the robot's folder"):
        Student(tmp_path).fly(str(scenario), 3, "mine.py")


def test_two_flights_of_one_case_do_not_know_of_each_other(tmp_path: Path) -> None:
    coast = (ROBOTS / "lander" / "controllers" / "coast.py").read_text()
    (tmp_path / "mine.py").write_text(
        coast.replace("0.0}", "0.1 * len(SEEN)}").replace("command:", "SEEN.append(1)\n        command:")
        + "\nSEEN = []\n"
    )
    student = Student(tmp_path)
    first, second = (student.fly("lander_vertical", 3, "mine.py") for _ in range(2))
    assert first.trace.digest == second.trace.digest
