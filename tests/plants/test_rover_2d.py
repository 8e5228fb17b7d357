"""The rover in the plane: its loads, what it holds and touches; closed forms of its motion are in physics_cases."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from snr_sim.plants.ground.dc_motor import Drive
from snr_sim.plants.ground.height_map import HeightMap, flat, ramp
from snr_sim.plants.ground.rocks import Ledge, Rock
from snr_sim.plants.ground.rover import Rover, RoverStart
from snr_sim.plants.ground.rover_2d import Rover2D
from snr_sim.plants.ground.rover_file import read_rover
from snr_sim.plants.ground.rover_loads import RoverLoads
from snr_sim.plants.ground.rover_vehicle import NO_MOTOR, Wheel
from snr_sim.plants.ground.terramechanics import DRY_SAND, Coulomb
from snr_sim.prelude.errors import ParameterError, PlantError
from snr_sim.prelude.ground_signals import DriveCommand
from tests.lanes import slow

VEHICLE = read_rover(Path(__file__).parents[2] / "robots" / "rover" / "vehicles" / "competition.toml")
GRAVITY = 9.80665
ROLLING_M = 0.1255


def made(ground: HeightMap | None = None, body: Any = Rover2D, **more: Any) -> Any:
    return body(VEHICLE, ground or flat(), lambda seed: RoverStart(), **more)


def go(rover: Any, seconds: float, mode: str = "", left: float = 0.0, right: float | None = None) -> Any:
    if mode:
        rover.write("drive", DriveCommand(mode, [left] * 3 + [left if right is None else right] * 3))
    for _ in range(round(seconds / rover.step_s)):
        rover.step(rover.step_s)
    return rover


# -- loads ------------------------------------------------------------------------------------------------------------


def test_loads_at_rest_and_under_drive_equal_those_in_mujoco() -> None:
    loads = RoverLoads(VEHICLE)
    rover = go(made(body=Rover), 1.0, "brake", 6.0)
    assert loads.shared(GRAVITY, [0.0] * 6, 0.0) == pytest.approx(rover.contacts.read_loads(), rel=0.01)
    go(rover, 0.4, "current", 3.0)
    drive_n = VEHICLE.mass_kg * rover.read("imu").specific_force_mps2[0] / 6.0
    assert loads.shared(GRAVITY, [drive_n] * 6, 0.0) == pytest.approx(rover.contacts.read_loads(), rel=0.015)


def test_loads_carry_the_weight_and_the_moment_of_side_forces() -> None:
    loads = RoverLoads(VEHICLE)
    found = loads.shared(GRAVITY, [5.0, -3.0, 8.0, 2.0, 0.0, -4.0], 50.0)
    assert math.fsum(found) == pytest.approx(43.0 * GRAVITY)
    across = math.fsum(load * wheel.position_m[1] for load, wheel in zip(found, VEHICLE.wheels, strict=True))
    assert across == pytest.approx(-50.0 * 0.27448, rel=1e-3), "height of the center of mass"


def test_wheel_that_would_be_pulled_down_carries_nothing() -> None:
    assert RoverLoads(VEHICLE).shared(GRAVITY, [0.0] * 6, 1000.0)[0] == 0.0


def test_rigid_vehicle_stands_as_on_equal_springs() -> None:
    """Four wheels, the center of mass ahead and to the left: loads are a plane over x and y (closed form)."""
    wheels = tuple(replace(w, hangs_on="chassis") for w in VEHICLE.wheels if w.name in ("LF", "LB", "RF", "RB"))
    cart = replace(VEHICLE, wheels=wheels, suspension=None, center_of_mass_m=(0.05, 0.02, 0.2))
    loads = RoverLoads(cart)
    at = np.array([(1.0, *wheel.position_m[:2]) for wheel in wheels])
    x, y = loads.center_m
    weight = cart.mass_kg * GRAVITY
    expected = at @ np.linalg.solve(at.T @ at, weight * np.array([1.0, x, y]))
    assert loads.shared(GRAVITY, [0.0] * 4, 0.0) == pytest.approx(expected.tolist())


# -- motion against closed forms --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("degrees", "holds"), [(-0.5, True), (0.5, False)])
def test_locked_rover_holds_up_to_the_angle_of_friction(degrees: float, holds: bool) -> None:
    angle = math.atan(0.5) + math.radians(degrees)
    rover = made(ramp((math.tan(angle), 0.0)), soil=Coulomb(0.5))
    rover._friction.set_drives([Drive(friction_nm=1e3)] * 6)
    go(rover, 1.0)
    assert (rover.speed_mps < 0.015) == holds


def test_neutral_brake_holds_up_to_its_torque() -> None:
    """Six brakes of 4 A and bearings: 3.98 N m a wheel, or 26.8 degrees."""
    torque = 4.0 * VEHICLE.motor.nm_per_a + VEHICLE.motor.friction_nm
    limit = math.asin(6.0 * torque / ROLLING_M / (VEHICLE.mass_kg * GRAVITY))
    for angle, holds in ((limit - 0.01, True), (limit + 0.01, False)):
        rover = go(made(ramp((math.tan(angle), 0.0))), 1.5)
        assert (rover.speed_mps < 0.01) == holds


@pytest.mark.parametrize("degrees", [0.0, slow(5.0)])
def test_slip_on_sand_is_that_in_mujoco(degrees: float) -> None:
    slips = []
    for body in (Rover, Rover2D):
        rover = go(made(ramp((math.tan(math.radians(degrees)), 0.0)), body, soil=DRY_SAND), 5.0, "speed", 4.0)
        rates = [rover.read(f"motor_{wheel.name}").speed_radps for wheel in VEHICLE.wheels]
        slips.append(1.0 - rover.speed_mps / (ROLLING_M * math.fsum(rates) / 6.0))
    assert slips[1] == pytest.approx(slips[0], abs=0.02)


# -- what it touches --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rock", "is_touched"),
    [
        slow(Rock((1.5, 0.0, 0.2), 0.3), True),
        (Rock((1.5, 0.38, -0.18), 0.25), True),  # 7 cm high, before a wheel
        (Rock((1.5, 0.0, -0.18), 0.25), False),  # the same between the wheels, under the chassis
        (Rock((1.5, 0.38, -0.27), 0.3), False),  # 3 cm high: it rolls over it
        slow(Ledge((1.5, 0.0, 0.1), (0.1, 2.0, 0.2)), True),
    ],
)
def test_rover_is_stopped_by_what_it_cannot_drive_over(rock: Rock | Ledge, is_touched: bool) -> None:
    rover = go(made(obstacles=(rock,)), 6.0, "speed", 3.0)
    assert (rover.state.hits > 0, rover.hit_n > 0.0) == (is_touched, is_touched)
    assert (rover.state.position_m[0] < 1.4) == is_touched


def test_start_inside_an_obstacle_is_refused() -> None:
    with pytest.raises(ParameterError, match="touches an obstacle"):
        made(obstacles=(Rock((0.3, 0.0, 0.1), 0.3),))


def test_state_that_is_not_finite_is_reported() -> None:
    rover = made()
    rover.state = rover.state._replace(speeds=(math.inf, 0.0, 0.0))
    with pytest.raises(PlantError, match="no longer finite"):
        go(rover, 1.0)


def test_inertial_unit_feels_slope_and_turns() -> None:
    rover = go(made(ramp((0.2, 0.0))), 1.0, "brake", 6.0)
    up = math.atan(0.2)
    assert rover.read("imu").specific_force_mps2 == pytest.approx(
        [GRAVITY * math.sin(up), 0.0, GRAVITY * math.cos(up)], abs=0.01
    )
    rover = go(made(), 3.0, "speed", 2.0, 6.0)
    imu = rover.read("imu")
    assert imu.rate_radps == pytest.approx([0.0, 0.0, rover.state.speeds[2]], abs=1e-12)
    assert imu.specific_force_mps2[1] == pytest.approx(rover.state.speeds[2] * rover.speed_mps, rel=0.05)


# -- against MuJoCo ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("left", "right"), [(5.0, 5.0), (-6.0, 6.0), (2.0, 6.0)])
def test_twin_moves_as_the_rover_in_mujoco(left: float, right: float) -> None:
    """Within 2.5 %: friction of MuJoCo's soft contacts is not quite opposite to their slip."""
    twin, rover = (go(made(body=body), 3.0, "speed", left, right) for body in (Rover2D, Rover))
    assert twin.read("imu").rate_radps[2] == pytest.approx(rover.read("imu").rate_radps[2], rel=0.025, abs=1e-3)
    assert twin.speed_mps == pytest.approx(rover.speed_mps, rel=0.025, abs=0.02)


def test_caster_in_the_middle_leaves_loads_and_motion_symmetric() -> None:
    caster = Wheel("C", (-0.6, 0.0, 0.13), 0.13, 0.05, 0.5, friction_scale=0.0, motor=NO_MOTOR)
    vehicle = replace(VEHICLE, wheels=(*VEHICLE.wheels, caster))
    rover = Rover2D(vehicle, flat(), lambda seed: RoverStart())
    go(rover, 0.2, "speed", 4.0)
    *loads, _ = rover.loads_n
    assert loads[:3] == pytest.approx(loads[3:])
    assert rover.state.heading_rad == pytest.approx(0.0, abs=1e-9)


def test_wheels_in_one_line_across_are_refused() -> None:
    places = ((0.0, 0.4, 0.13), (0.0, -0.4, 0.13), (0.0, 0.2, 0.13))
    wheels = tuple(
        replace(wheel, hangs_on="chassis", position_m=place)
        for wheel, place in zip(VEHICLE.wheels, places, strict=False)
    )
    with pytest.raises(ParameterError, match=r"do not hold it upright(.|\n)*before and behind"):
        RoverLoads(replace(VEHICLE, wheels=wheels, suspension=None))
