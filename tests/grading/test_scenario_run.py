"""A run with the student's components in a process of their own equals that of `snr run`."""

import shutil
from pathlib import Path

import pytest

from snr_sim.grading.lab.stimulus import Stimulus
from snr_sim.grading.lab.student import Student
from snr_sim.grading.lab.verdicts import GraderError, SubmissionError
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import LogLineRecord
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

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
    run_recorded(prepare(request), folder / FILE_NAME)
    return read_trace(folder / FILE_NAME).digest


# Everything that a component may do, in one controller: loops that stop and set their time, life cycle steps, random
# numbers, arrays, handlers that change, pages never stored, two that handle one task, further scheduled tasks.
EVERYTHING = """
import numpy as np
from beside import GAIN
from snr_sim import Endpoint, Loop, LoopFactory, Page, Task, TaskType, tasks

def factories(robot):
    return [Part.factory("one"), TickFactory(), Part.factory("two")]

class Part(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar, TaskType.event: self.on_event}

    def begin(self):
        self.schedule(tasks.event("begun", [self.name]))
        return tasks.event("returned_by_begin")

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
        return [tasks.event("returned_by_loop")]
"""


def test_graded_run_with_all_component_features_equals_plain_run(tmp_path: Path) -> None:
    submission = tmp_path / "submission"
    submission.mkdir()
    (submission / "everything.py").write_text(EVERYTHING)
    (submission / "beside.py").write_text("GAIN = 0.5\n")
    graded_run = Student(submission, record_to=tmp_path / "runs").run_scenario("lander_vertical", 11, "everything.py")
    assert graded_run.folder is not None
    run = Request("lander_vertical", seed=11, controller=str(submission / "everything.py"))
    assert graded_run.trace.digest == digest_of_run(tmp_path, run)
    printed = {
        (one.component, one.level, one.text) for one in graded_run.trace.records if isinstance(one, LogLineRecord)
    }
    assert printed == {("one", "INFO", "noise"), ("one", "PRINT", "a line in two")}
    assert len(graded_run.pages("tick")) == 41
    assert len(graded_run.pages("heard_two")) > 5
    assert any("never_stored" in note for note in graded_run.notes)
    assert any("too_late" in note for note in graded_run.notes)
    assert graded_run.truth()[0][1]["poses"]


BLINK = """
from snr_sim.behaviors import after, machine, machine_parts, state

def burn(m):
    return m.store_data_task("engine", {"throttle": 1.0})

STATES = [state("off", after(0.333, to="on")), state("on", after(0.25, to="off"), enter=burn)]

def factories(robot):
    return machine_parts(machine("blink", "off", STATES), "blink", step_hz=0)
"""


def test_graded_run_of_a_machine_without_a_clock_equals_plain_run(tmp_path: Path) -> None:
    submission = tmp_path / "submission"
    submission.mkdir()
    (submission / "blink.py").write_text(BLINK)
    graded_run = Student(submission, record_to=tmp_path / "runs").run_scenario("lander_vertical", 11, "blink.py")
    run = Request("lander_vertical", seed=11, controller=str(submission / "blink.py"))
    assert graded_run.trace.digest == digest_of_run(tmp_path, run)
    assert len(graded_run.pages("blink")) > 5


def test_tasks_of_a_failed_component_are_not_attributed_to_another(tmp_path: Path) -> None:
    fails = 'self.schedule(tasks.event("begun"))\n        if self.name == "two": raise ValueError'
    begins = 'self.schedule(tasks.event("begun", [self.name]))'
    assert begins in EVERYTHING
    (tmp_path / "everything.py").write_text(EVERYTHING.replace(begins, fails))
    (tmp_path / "beside.py").write_text("GAIN = 0.5\n")
    run = run_recorded(
        prepare(Request("lander_vertical", seed=11, controller=str(tmp_path / "everything.py"))), tmp_path / FILE_NAME
    )
    graded_run = Student(tmp_path).run_scenario("lander_vertical", 11, "everything.py", may_fail=True)
    assert "ValueError" in graded_run.error
    assert graded_run.notes == run.notes


@pytest.mark.parametrize(
    ("scenario", "controller"),
    [
        ("lander_vertical", "lander/controllers/coast.py"),
        ("lander_vertical", "lander/controllers/optimal.py"),
        ("lander_pad", "lander/controllers/pad.py"),
        ("urov_depth_hold", "urov/controllers/holds.py"),
        ("dora_wall", "dora/controllers/stop.lrp"),
    ],
)
def test_graded_run_has_the_trace_digest_of_a_plain_run(scenario: str, controller: str, tmp_path: Path) -> None:
    if scenario.startswith("urov"):  # the first seconds are enough: it is armed, and the link is up
        text = (SCENARIOS / f"{scenario}.py").read_text() + SHORT
        scenario = str(tmp_path / "urov_short.py")
        Path(scenario).write_text(text)
    submission = tmp_path / "submission"
    submission.mkdir()
    file = Path(shutil.copy(ROBOTS / controller, submission)).name
    graded_run = Student(submission, record_to=tmp_path / "runs").run_scenario(scenario, 3, file)
    assert graded_run.folder is not None
    digest = read_trace(graded_run.folder / FILE_NAME).digest
    assert digest == digest_of_run(tmp_path, Request(scenario, seed=3, controller=str(submission / file)))


def test_machine_in_a_text_is_edited_in_a_graded_run(tmp_path: Path) -> None:
    text = (ROBOTS / "dora" / "controllers" / "stop.lrp").read_text()
    (tmp_path / "mine.lrp").write_text(text)
    edits = [text.replace("[55]", "[30]"), "(machine"]
    inputs = [Stimulus(1.0 + i, task=("event", "dora.edit", [edit])) for i, edit in enumerate(edits)]
    run = Student(tmp_path).run_scenario("dora_wall", 3, "mine.lrp", inputs=inputs)
    assert [(time_s, page["ok"]) for time_s, page in run.pages("dora.edited")] == [(1.0, True), (2.0, False)]
    (tmp_path / "mine.lrp").write_text(text.replace("[robot.stop()]", "[robot.stopp()]"))
    with pytest.raises(SubmissionError, match=r"mine.lrp:9:28: .*stopp"):
        Student(tmp_path).run_scenario("dora_wall", 3, "mine.lrp")


def test_refused_import_beside_a_machine_in_a_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "mine.lrp").write_text('(actions "moves.py") (machine dora (state a)) (spawn dora a)')
    (tmp_path / "moves.py").write_text("import math\nimport socket\n")
    with pytest.raises(SubmissionError, match=r"moves.py, line 2: imports socket"):
        Student(tmp_path).run_scenario("dora_wall", 3, "mine.lrp")


def test_failed_run_is_returned_with_may_fail(tmp_path: Path) -> None:
    raises = (
        (ROBOTS / "lander" / "controllers" / "coast.py")
        .read_text()
        .replace("return self", "assert not self.get_data('radar_prev')\n        return self")
    )
    (tmp_path / "mine.py").write_text(raises)
    graded_run = Student(tmp_path).run_scenario("lander_vertical", 3, "mine.py", may_fail=True)
    assert (graded_run.outcome, graded_run.success, graded_run.folder) == ("error", False, None)
    assert graded_run.error.startswith("mine.py, line ")
    assert len(graded_run.pages("radar")) == 2


def test_failing_scenario_raises_grader_error(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text((ROBOTS / "lander" / "controllers" / "coast.py").read_text())
    broken = tmp_path / "broken.py"
    broken.write_text((SCENARIOS / "lander_vertical.py").read_text() + "\n\ndef verdict(plant):\n    return 1 / 0\n")
    with pytest.raises(GraderError, match="ZeroDivisionError"):
        Student(tmp_path).run_scenario(str(broken), 3, "mine.py")


def test_parameters_of_a_scenario_class_raise_grader_error(tmp_path: Path) -> None:
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
    with pytest.raises(GraderError, match="define such classes in the robot's folder"):
        Student(tmp_path).run_scenario(str(scenario), 3, "mine.py")


def test_runs_of_one_case_are_independent(tmp_path: Path) -> None:
    coast = (ROBOTS / "lander" / "controllers" / "coast.py").read_text()
    (tmp_path / "mine.py").write_text(
        coast.replace("0.0}", "0.1 * len(SEEN)}").replace("return self", "SEEN.append(1)\n        return self")
        + "\nSEEN = []\n"
    )
    student = Student(tmp_path)
    first, second = (student.run_scenario("lander_vertical", 3, "mine.py") for _ in range(2))
    assert first.trace.digest == second.trace.digest
