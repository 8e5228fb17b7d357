"""The rover's arm: inverse kinematics against the arm in MuJoCo, and a line that its wrist keeps."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from snr_sim.plants import HeightMap, Manipulator, Rover, RoverStart
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from tests.scenarios.recorded import simulate

library.load_robot(library.find("robots", "rover"))

from snr_sim_robot_rover.arm import angles_rad, wrist_m  # noqa: E402
from snr_sim_robot_rover.parameters import vehicle  # noqa: E402

ARM = Manipulator()


def test_wrist_is_where_its_angles_were_asked_for() -> None:
    for radius in (0.3, 0.5, 0.75):
        for height in (-0.2, 0.0, 0.35):
            angles = angles_rad(ARM, radius, height)
            assert angles is not None
            assert angles[1] < 0.0, "the elbow is up"
            assert wrist_m(ARM, *angles) == pytest.approx((radius, height))


@pytest.mark.parametrize("place", [(0.9, 0.0), (0.0, 0.01), (0.1, -0.8)])
def test_place_that_the_arm_cannot_reach_has_no_angles(place: tuple[float, float]) -> None:
    assert angles_rad(ARM, *place) is None


def test_kinematics_are_those_of_the_arm_in_mujoco() -> None:
    rest = (0.0, 0.7, -1.1, 0.4, 0.0, 0.0)
    level = HeightMap([[0.0] * 3] * 3, 10.0, (-10.0, -10.0))
    rover = Rover(replace(vehicle(), arm=replace(ARM, rest_rad=rest)), level, lambda seed: RoverStart())
    poses = rover.truth()["poses"]
    reach = [b - a for a, b in zip(poses["arm_upper"][:3], poses["arm_wrist"][:3], strict=True)]
    _, shoulder, elbow, *_ = rover.read("arm").angles_rad
    pitch_up = -rover.truth()["values"]["pitch_rad"]
    expected = wrist_m(ARM, shoulder + pitch_up, elbow)
    assert (math.hypot(reach[0], reach[1]), reach[2]) == pytest.approx(expected, abs=1e-3)


def test_wrist_keeps_its_height_along_the_line(tmp_path: Path) -> None:
    result = simulate("rover_arm mujoco 0", tmp_path)
    assert (result.outcome, result.success, result.notes) == ("reached", True, [])
    assert 0.001 < result.metrics["off_m"] < 0.004, "servos give by some millimetres"


def test_wrist_that_leaves_its_line_fails() -> None:
    simulation = prepare(Request("rover_arm"))
    plant = simulation.plant()
    height, begin, end = simulation.scenario.parameters(0).arm_line_m
    plant.wrists_m = [(0.2, 0.9), (begin, height), (begin + 0.1, height + 0.006), (end, height)]
    verdict = simulation.scenario.verdict(plant)
    assert (verdict.outcome, verdict.success) == ("off the line", False)
    plant.wrists_m[2] = (begin + 0.1, height + 0.004)
    assert simulation.scenario.verdict(plant).success
