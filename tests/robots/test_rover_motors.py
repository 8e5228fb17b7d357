"""Broken motors of the rover: how they are found, and how it copes."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from snr_sim.prelude.task import Page
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import PageRecord
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.lanes import nightly, slow
from tests.scenarios.recorded import simulate

library.load_robot(library.find("robots", "rover"))

from snr_sim_robot_rover.motor_watch import SILENT_S, SUSTAINED_S, MotorJudge  # noqa: E402
from snr_sim_robot_rover.odometry import WheelOdometry  # noqa: E402
from snr_sim_robot_rover.parameters import RoverParameters  # noqa: E402

NAMES = [f"motor_{name}" for name in ("LF", "LM", "LB", "RF", "RM", "RB")]
LIMIT_A = 6.0
FOUND_S = 2.0


def judged(changed: dict[str, dict[str, float]], for_s: float, **options: Any) -> dict[str, str]:
    """What a judge finds in motors of 1 A and 5 rad/s each, but for what is changed."""
    judge = MotorJudge(LIMIT_A)
    motors = {name: {"current_a": 1.0, "speed_radps": 5.0, **changed.get(name, {})} for name in NAMES}
    asked = dict.fromkeys(NAMES, options.get("asked_radps", 5.0)) if options.get("is_asked", True) else {}
    ages_s = {name: motors[name].pop("age_s", 0.0) for name in NAMES}
    for i in range(round(for_s / 0.02) + 1):
        judge.judge(0.02 * i, asked, motors, ages_s)
    return judge.faults


def test_whole_motors_are_not_found_broken_by_noise() -> None:
    rng, judge = random.Random(1), MotorJudge(LIMIT_A)
    for i in range(3000):
        motors = {name: {"current_a": rng.gauss(0.8, 0.3), "speed_radps": rng.gauss(5.0, 1.0)} for name in NAMES}
        assert not judge.judge(0.02 * i, dict.fromkeys(NAMES, 5.0), motors, dict.fromkeys(NAMES, 0.05))
    assert judge.faults == {}


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"current_a": 0.02}, "dead"),
        ({"current_a": 5.9, "speed_radps": 0.1}, "drags"),
        ({"current_a": 5.9, "speed_radps": -2.0}, "drags"),
    ],
)
def test_motor_is_found_broken_once_it_looks_so_for_long_enough(changed: dict[str, float], fault: str) -> None:
    assert judged({"motor_LM": changed}, SUSTAINED_S - 0.05) == {}
    assert judged({"motor_LM": changed}, SUSTAINED_S + 0.05) == {"motor_LM": fault}
    assert SUSTAINED_S < FOUND_S


def test_silence_is_found_whatever_is_asked() -> None:
    assert judged({"motor_RB": {"age_s": SILENT_S + 0.01}}, 0.0, is_asked=False) == {"motor_RB": "silent"}
    assert judged({"motor_RB": {"age_s": SILENT_S - 0.01}}, 5.0) == {}


def test_motor_that_is_asked_for_hardly_a_speed_or_for_none_is_not_judged() -> None:
    dead = {"motor_LM": {"current_a": 0.0}}
    assert judged(dead, 5.0, asked_radps=0.5) == {}
    assert judged(dead, 5.0, is_asked=False) == {}


def test_motors_that_all_coast_are_whole() -> None:
    assert judged({name: {"current_a": 0.1} for name in NAMES[:-1]} | {NAMES[-1]: {"current_a": 0.0}}, 5.0) == {}


def test_wheel_that_hangs_on_a_rock_for_a_moment_is_whole() -> None:
    judge = MotorJudge(LIMIT_A)
    for i in range(500):
        hangs = i % 30 < 25  # of 0.6 s, for 0.5
        motors: dict[str, Any] = {name: {"current_a": 1.0, "speed_radps": 5.0} for name in NAMES}
        if hangs:
            motors["motor_LF"] = {"current_a": 6.0, "speed_radps": 0.0}
        judge.judge(0.02 * i, dict.fromkeys(NAMES, 5.0), motors, dict.fromkeys(NAMES, 0.0))
    assert judge.faults == {}


@pytest.mark.parametrize("unknown", [(1,), (0, 1, 2), (3, 4, 5), (0, 1, 2, 3, 4)])
def test_odometry_continues_with_the_wheels_that_are_known(unknown: tuple[int, ...]) -> None:
    parameters = RoverParameters()
    whole, rest = WheelOdometry(parameters), WheelOdometry(parameters)
    for i in range(200):
        yaw, half = 0.01 * i, 0.01 * 2.5 * 0.38  # a curve at the factor that it begins with
        ways = [0.05 * i - half * i] * 3 + [0.05 * i + half * i] * 3
        turned = [way / (0.13 - parameters.tyre_m) for way in ways]
        whole.update(turned, yaw, 0.0, 0.05 * i)
        rest.update([None if j in unknown else one for j, one in enumerate(turned)], yaw, 0.0, 0.05 * i)
    assert whole.way_m == pytest.approx(0.05 * 199)
    assert rest.position_m == pytest.approx(whole.position_m, abs=1e-6)


def test_odometry_of_no_wheel_stands() -> None:
    odometry = WheelOdometry(RoverParameters())
    for i in range(3):
        odometry.update([None] * 6, 0.1 * i, 0.0, 0.05 * i)
    assert (odometry.way_m, odometry.position_m) == (0.0, (0.0, 0.0))


@pytest.mark.parametrize(
    ("run", "fault"),
    [
        ("rover_dead_motor pymunk 0", "dead"),
        slow("rover_dead_motor pymunk 1", "drags"),
        slow("rover_dead_motor pymunk 2", "silent"),
        slow("rover_dead_motor mujoco 0", "dead"),
        nightly("rover_dead_motor mujoco 1", "drags"),
        nightly("rover_dead_motor mujoco 2", "silent"),
    ],
)
def test_broken_motor_is_found_in_time_and_the_rover_keeps_its_line(run: str, fault: str, tmp_path: Path) -> None:
    result = simulate(run, tmp_path)
    assert (result.outcome, result.success) == ("arrived", True)
    assert result.metrics["fault"] == fault
    assert result.metrics["off_m"] < 0.3
    found = [
        (record.t, faults)
        for record in read_trace(tmp_path / FILE_NAME).records
        if isinstance(record, PageRecord) and record.name == "motor_faults"
        if (faults := decode_value(bytes(record.values), {"page": Page})[0].data["faults"])
    ]
    assert [faults for _, faults in found] == [{f"motor_{result.metrics['motor']}": fault}]
    assert found[0][0] - result.metrics["broke_s"] < FOUND_S


RACER = """
from snr_sim import Endpoint, handles


def factories(robot):
    return [Racer.factory()]


class Racer(Endpoint):
    @handles("imu")
    def on_imu(self, imu):
        return self.store_data_task("drive", {"mode": "current", "values": [1.5] * 6})
"""


def test_lifted_wheels_race_under_torque_but_not_under_a_speed(tmp_path: Path) -> None:
    result = simulate("rover_wheel_up mujoco 0", tmp_path)
    assert (result.outcome, result.success, result.metrics["lifted"]) == ("passed", True, ["RB", "RF", "RM"])
    (tmp_path / "racer.py").write_text(RACER, encoding="utf-8")
    simulation = prepare(Request("rover_wheel_up", controller=str(tmp_path / "racer.py")))
    plant = simulation.plant()
    raced = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert (raced.outcome, raced.success) == ("a wheel raced", False)
    assert raced.metrics["ratio"] > 1.5 > result.metrics["ratio"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_broken_motor_is_found_over_its_serial_line_too(seed: int) -> None:
    simulation = prepare(Request("rover_dead_motor", seed, "pymunk", io="emulated"))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert (result.outcome, result.success) == ("arrived", True), result
