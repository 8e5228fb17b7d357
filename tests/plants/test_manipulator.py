"""The arm of a rover: its torques and its energy in closed form, its limits, what it refuses."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from snr_sim.plants.ground.height_map import flat
from snr_sim.plants.ground.manipulator import STIFF_RAD, Manipulator
from snr_sim.plants.ground.rover import Rover, RoverStart
from snr_sim.plants.ground.rover_2d import Rover2D
from snr_sim.plants.ground.rover_file import read_rover
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError
from snr_sim.prelude.ground_signals import ArmCommand
from snr_sim.testing.contracts import check_plant

BARE = read_rover(Path(__file__).parents[2] / "robots" / "rover" / "vehicles" / "competition.toml")
ARM = Manipulator()
GRAVITY = 9.80665
POSE = (0.5, 0.4, -0.9, 0.3, 0.2, 0.0)
QUICK = replace(ARM, rate_radps=10.0)


def made(arm: Manipulator | None = ARM, **more: Any) -> Rover:
    return Rover(replace(BARE, arm=arm), flat(), lambda seed: RoverStart(), **more)


def go(rover: Rover, seconds: float, angles: Sequence[float] | None = None) -> Rover:
    if angles is not None:
        rover.write("arm", ArmCommand(list(angles)))
    for _ in range(round(seconds / rover.step_s)):
        rover.step(rover.step_s)
    return rover


def test_servo_gives_by_its_share_of_its_torque() -> None:
    """At rest no part moves; moments of gravity are in tests/physics."""
    found = go(made(replace(ARM, rest_rad=POSE)), 0.1).read("arm")
    sags = [goal - now for goal, now in zip(POSE, found.angles_rad, strict=True)]
    expected = [torque * STIFF_RAD / limit for torque, limit in zip(found.torques_nm, ARM.torques_nm, strict=True)]
    assert sags == pytest.approx(expected, abs=1e-6)
    assert found.torques_nm[1] > 10.0
    assert max(map(abs, found.rates_radps)) < 1e-3


def test_joints_stop_at_their_limits_and_stay_where_neutral_finds_them() -> None:
    rover = go(made(QUICK), 0.8, [9.0, 9.0, 9.0, -9.0, 9.0, 9.0])
    expected = [high if i != 3 else ARM.lows_rad[3] for i, high in enumerate(ARM.highs_rad)]
    assert rover.read("arm").angles_rad == pytest.approx(expected, abs=0.01)
    go(rover, 0.2, POSE)
    held = go(rover, 0.8, []).read("arm").angles_rad
    for _ in range(20):
        go(rover, 0.01, [])
    assert rover.read("arm").angles_rad == pytest.approx(held, abs=1e-3), "it does not creep down"


@pytest.mark.slow
def test_rover_with_an_arm_keeps_the_contract_of_plants() -> None:
    check_plant(made, {"arm": ArmCommand(list(POSE))})


def test_invalid_command_of_the_arm_is_refused() -> None:
    rover = made()
    for angles in ([0.0] * 5, [math.nan] * 6):
        with pytest.raises(PlantError, match="base, shoulder"):
            rover.write("arm", ArmCommand(angles))
    for plant, name in ((made(None), "arm"), (rover, "drive")):
        with pytest.raises(UnknownNameError, match="not an arm"):
            plant.write(name, ArmCommand())
    with pytest.raises(ParameterError, match="in the plane"):
        Rover2D(rover.vehicle, flat(), lambda seed: RoverStart())
    with pytest.raises(ParameterError, match="rest_rad"):
        Manipulator(rest_rad=(0.0, 3.0, -1.0, 0.0, 0.0, 0.0))


def test_arm_counts_to_the_mass_and_shows_in_scene_and_truth() -> None:
    rover = made()
    assert rover.vehicle.mass_kg == pytest.approx(BARE.mass_kg + 3.9)
    assert sum(rover.contacts.read_loads()) == pytest.approx(rover.vehicle.mass_kg * GRAVITY, rel=1e-3)
    parts = {rod.name for rod in ARM.rods}
    assert parts <= set(rover.scene()["bodies"]) & set(rover.truth()["poses"])
