"""The lab "sim to Pi": the commands of its pages work, and its reference holds and is safe."""

import math
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from snr_sim import Config, Endpoint, EndpointFactory, Loop, LoopFactory, SimRunner, TaskType
from snr_sim.cli.main import app
from snr_sim.devices.emulated.toolchain import ToolsMissingError
from snr_sim.grading.lab.lab import Case, find_lab
from snr_sim.grading.lab.student import Student
from snr_sim.grading.lab.verdicts import GraderError
from snr_sim.prelude.scenario import RobotInfo
from snr_sim.scenario.library import load_controller
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.sim_to_pi.mistakes import MISTAKES

ROOT = Path(__file__).parents[2]
NAME = "08_sim_to_pi"
FLIGHTS = ("holds", "holds_on_the_board")
LAB = ROOT / "assignments" / NAME
REFERENCE = Path(__file__).parent / "sim_to_pi" / "reference" / "depth_hold.py"
DISARMED = {"number": 1, "is_armed": False, "is_stop": False, "clears_stop": False, "depth_m": None}
ARMED = {**DISARMED, "is_armed": True, "depth_m": 3.0}
IMU = {"roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": 0.0}


@pytest.mark.unmeasured
@pytest.mark.nightly  # those of lab 1 and 11 are tried before each landing
def test_commands_of_lab_have_documented_results_and_reference_holds(
    type_page: Callable[..., dict[str, str]], emulators: None
) -> None:
    def solve(folder: Path) -> None:
        for name in ("depth_hold.py", "answers.md"):
            shutil.copy(REFERENCE.parent / name, folder / "depth_lab")

    printed = type_page(LAB / "README.md", {"snr trace depth_lab/first": solve})
    assert "did not settle after the step" in next(
        output for line, output in printed.items() if "depth_lab/first" in line
    )
    compared = next(output for line, output in printed.items() if line.endswith("emulated/*"))
    assert "0 | 20 ms after the command" in " ".join(compared.split())  # the table breaks lines where it must


@pytest.mark.unmeasured
def test_reference_gets_all_points_on_hidden_cases(mark: Callable[..., Any], emulators: None) -> None:
    assert mark(NAME, is_hidden=True, single_hidden=FLIGHTS) == ({}, "")


@pytest.mark.nightly
def test_reference_gets_all_points_on_all_cases(mark: Callable[..., Any], emulators: None) -> None:
    assert mark(NAME, is_hidden=True) == ({}, "")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [200, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(201, 250))])
def test_reference_has_margin_in_simulation(seed: int) -> None:
    simulation = prepare(Request("urov_depth_hold", seed=seed, controller=str(REFERENCE)))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert result.success
    assert result.metrics["settling_s"] < 10.0  # of 12
    assert result.metrics["overshoot_m"] < 0.1  # of 0.2
    assert result.metrics["steady_error_m"] < 0.03  # of 0.05


@pytest.mark.parametrize(
    ("name", "dives"),
    [
        *((name, "holds" in mistake.lost) for name, mistake in MISTAKES.items()),
        *(
            pytest.param(name, True, marks=pytest.mark.nightly)
            for name in MISTAKES
            if "holds" not in MISTAKES[name].lost
        ),
    ],
)
def test_wrong_solution_loses_listed_points_and_skips_board(
    mark: Callable[..., Any], leave_out: Callable[..., None], name: str, dives: bool
) -> None:
    leave_out(*([] if dives else ["holds"]))
    found = mark(NAME, name)
    assert found.lost == {**MISTAKES[name].lost, "holds_on_the_board": 20.0}
    assert MISTAKES[name].hint in found.feedback


@pytest.mark.parametrize(
    ("answers", "missed"),
    [
        (["The outputs follow after 20 ms, as pulses are made only then."] * 5, {1, 2, 3, 4, 5}),
        ([f"This is a sentence with a number in it: {i}." for i in range(5)], {1, 2, 3, 4, 5}),
        ([f"In my two runs it was {i} ms later than it had been." for i in range(5)], set()),
        (["too short: 3 ms", *[f"In my runs that took {i} % more than before it." for i in range(4)]], {1}),
    ],
)
def test_answer_needs_distinct_text_with_number_and_unit(answers: list[str], missed: set[int], tmp_path: Path) -> None:
    (tmp_path / "answers.md").write_text("\n".join(f"## {i}. Why?\n\n{text}\n" for i, text in enumerate(answers, 1)))
    answered = next(one for one in find_lab(NAME).checks if one.name == "answered")
    with Student(tmp_path) as student:
        found = {i for i in range(1, 6) if answered.evaluate(student, Case(i, is_visible=True)).fraction < 1.0}
    assert found == missed


def test_starter_fails_with_hints(mark: Callable[..., Any]) -> None:
    found = mark(NAME, starter=True)
    assert set(found.lost) == {"stale", "stop", "holds", "holds_on_the_board", "answered"}
    assert "are the pulses beyond the dead band" in found.feedback


@pytest.mark.slow
def test_missing_emulator_packages_cost_no_points(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*args: Any) -> None:
        raise ToolsMissingError("The emulated microcontroller needs gcc-avr.", fix="apt install gcc-avr")

    monkeypatch.setattr("snr_sim.devices.emulated.board.Board.__init__", refuse)
    on_the_board = next(one for one in find_lab(NAME).checks if one.name == "holds_on_the_board")
    with Student(REFERENCE.parent) as student, pytest.raises(GraderError, match="gcc-avr"):
        on_the_board.evaluate(student, Case(0, is_visible=True))


def test_commands_and_pictures_of_pages_exist() -> None:
    verbs: Any = get_command(app)
    for page in ("README.md", "bench.md"):
        text = (LAB / page).read_text()
        for picture in re.findall(r"\]\(((?:pictures/|\.\./)[^)]*|bench\.md)\)", text):
            assert (LAB / picture).exists(), picture
        for verb, rest in re.findall(r"^ *snr (\w+)(.*)$", text, flags=re.MULTILINE):
            known = {option for parameter in verbs.get_command(None, verb).params for option in parameter.opts}
            assert set(re.findall(r" (--[a-z-]+)", rest.partition("  #")[0])) <= known, rest


class PagesFactory(LoopFactory):
    """Stores what a table says, at its times: {key: (rate, what to store at a time, or nothing)}."""

    def __init__(self, key: str, rate_hz: float, data_at: Any) -> None:
        super().__init__()
        self.key, self.rate_hz, self.data_at = key, rate_hz, data_at

    def get(self, parent: Any) -> Loop:
        return Pages(self, parent, f"{self.key}_sensor", self.rate_hz)


class Pages(Loop):
    factory: PagesFactory

    def loop(self) -> None:
        data = self.factory.data_at(self.get_time_s())
        if data is not None:
            self.store_data(self.factory.key, data)


class WatchFactory(EndpointFactory):
    def __init__(self) -> None:
        super().__init__()
        self.pulses: list[tuple[float, list[float]]] = []

    def get(self, parent: Any) -> Endpoint:
        return Watch(self, parent, "watch")


class Watch(Endpoint):
    factory: WatchFactory

    def __init__(self, factory: WatchFactory, parent: Any, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {TaskType.store_page: self.on_page}

    def on_page(self, task: Any, task_id: Any) -> None:
        if task.name == "pwm":
            self.factory.pulses.append((self.get_time_s(), self.get_data("pwm")["pulses_us"]))


def pushed_at(tmp_path: Path, controls_at: Any, depth_until_s: float = math.inf) -> list[float]:
    """When, within six seconds, the reference pushed."""
    shutil.copy(LAB / "starter" / "telling.py", tmp_path)
    shutil.copy(REFERENCE, tmp_path)
    robot = RobotInfo("urov", "urov", "urov_depth_hold", "mujoco", None, {})
    found: Any = type("Found", (), {"path": tmp_path, "name": "urov"})()
    controller = load_controller(found, str(tmp_path / "depth_hold.py"))
    watch = WatchFactory()

    def depth_at(t: float) -> Any:
        return {"depth_m": 1.0, "stamp_s": t} if t < depth_until_s else None

    loops = [
        PagesFactory("controls", 20.0, controls_at),
        PagesFactory("depth", 20.0, depth_at),
        PagesFactory("imu", 50.0, lambda t: IMU),
    ]
    SimRunner(Config(factories={"urov": [*loops, *controller.factories(robot), watch]}), until_s=6.0).run()
    assert all(1100.0 <= pulse <= 1900.0 for _, pulses in watch.pulses for pulse in pulses)
    return [t for t, pulses in watch.pulses if pulses != [1500.0] * 8]


def test_reference_pushes_only_while_armed(tmp_path: Path) -> None:
    times = pushed_at(tmp_path, lambda t: ARMED if 2.0 <= t < 4.0 else DISARMED)
    assert 2.0 <= times[0] < 2.2
    assert 3.9 < times[-1] < 4.05


def test_reference_stops_within_330_ms_of_last_controls_or_depth(
    tmp_path: Path,
) -> None:
    assert 3.0 < pushed_at(tmp_path, lambda t: ARMED if t < 3.0 else None)[-1] < 3.33
    assert 3.0 < pushed_at(tmp_path, lambda t: ARMED, depth_until_s=3.0)[-1] < 3.33


def test_reference_without_commanded_depth_holds_arming_depth(tmp_path: Path) -> None:
    def controls_at(t: float) -> Any:
        if t < 2.0:
            return ARMED if t < 1.0 else DISARMED  # asks for 3 m, and is disarmed: that is forgotten
        return {**ARMED, "depth_m": None}

    times = pushed_at(tmp_path, controls_at)
    assert times
    assert max(times) < 1.05  # the depth is as it was: nothing is to be done


def test_reference_keeps_stop_until_cleared_while_disarmed(tmp_path: Path) -> None:
    def controls_at(t: float) -> Any:
        if 2.0 <= t < 2.1:
            return {**ARMED, "is_stop": True}
        if 4.0 <= t < 4.1:
            return {**ARMED, "clears_stop": True}
        return {**DISARMED, "clears_stop": True} if 5.0 <= t < 5.1 else ARMED

    times = pushed_at(tmp_path, controls_at)
    assert max(t for t in times if t < 4.5) < 2.05
    assert 5.0 < min(t for t in times if t > 4.5) < 5.2
