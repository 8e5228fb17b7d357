"""The rover's sticks, drive and odometry: functions alone, and on the plant."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.plants import Rover, RoverStart
from snr_sim.plants.ground.height_map import flat
from snr_sim.plants.ground.rover_vehicle import NO_MOTOR, Wheel
from snr_sim.prelude.angles import roll_pitch_yaw_rad, wrap_rad
from snr_sim.prelude.errors import CommandError
from snr_sim.prelude.ground_signals import DriveCommand
from snr_sim.scenario import library

library.load_robot(library.find("robots", "rover"))

from snr_sim_robot_rover.drive import EFFECTIVE_TRACK, HeadingLoop, braked, side_values, wheel_rates  # noqa: E402
from snr_sim_robot_rover.odometry import WheelOdometry  # noqa: E402
from snr_sim_robot_rover.parameters import RoverParameters  # noqa: E402
from snr_sim_robot_rover.sticks import Sides, arcade, curve, tank  # noqa: E402

PARAMETERS = RoverParameters()
stick = st.floats(-2.0, 2.0)


# -- sticks ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("moved", "share"),
    [(0.0, 0.0), (0.0999, 0.0), (-0.0999, 0.0), (1.0, 1.0), (-1.0, -1.0), (7.0, 1.0), (-math.inf, -1.0)],
)
def test_curve_is_zero_in_the_dead_zone_and_all_at_the_end(moved: float, share: float) -> None:
    assert curve(moved) == share


@pytest.mark.parametrize("moved", [0.1, 0.25, 0.5, 0.9])
def test_curve_is_that_of_roveberrypy(moved: float) -> None:
    assert curve(moved) == pytest.approx((17.0**moved - 1.0) / 16.0)
    assert curve(-moved) == -curve(moved)


@given(stick, stick)
def test_curve_never_falls_as_a_stick_is_pushed(one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert -1.0 <= curve(low) <= curve(high) <= 1.0


def test_stick_that_is_nan_is_refused() -> None:
    for refused in (lambda: curve(math.nan), lambda: tank(0.5, math.nan), lambda: arcade(math.nan, 0.0)):
        with pytest.raises(CommandError, match="NaN"):
            refused()


def test_stick_without_a_value_is_not_a_command() -> None:
    assert (tank(None, 1.0), tank(1.0, None), arcade(None, 0.0), arcade(0.0, None)) == (None, None, None, None)


def test_tank_gives_each_side_its_stick() -> None:
    assert tank(1.0, -1.0) == Sides(1.0, -1.0)


def test_arcade_turns_left_with_the_right_side_ahead() -> None:
    assert arcade(0.0, 1.0) == Sides(-1.0, 1.0)
    assert arcade(1.0, 0.0) == Sides(1.0, 1.0)


@given(stick, stick)
def test_arcade_keeps_the_curve_within_the_limits(ahead: float, turn: float) -> None:
    sides = arcade(ahead, turn)
    assert sides is not None
    assert max(map(abs, sides)) <= 1.0 + 1e-12
    forward, about = curve(ahead), curve(turn)
    assert (sides.right + sides.left) * about == pytest.approx((sides.right - sides.left) * forward, abs=1e-12)


# -- drive ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mode", "limit"), [("speed", 1.5 / 0.13), ("current", 6.0), ("duty", 1.0)])
def test_sides_become_shares_of_what_the_mode_can(mode: str, limit: float) -> None:
    values = side_values(PARAMETERS, mode, Sides(0.5, -1.0))
    assert values == pytest.approx([0.5 * limit] * 3 + [-limit] * 3)


def test_brake_wins_over_the_stick_of_its_side_only() -> None:
    values, speeds = [3.0] * 6, [4.0, 40.0, -4.0, 4.0, 4.0, 4.0]
    assert braked(PARAMETERS, "speed", values, ["left"], speeds) == [0.0, 0.0, 0.0, 3.0, 3.0, 3.0]
    assert braked(PARAMETERS, "duty", values, ["right"], speeds) == [3.0, 3.0, 3.0, 0.0, 0.0, 0.0]
    assert braked(PARAMETERS, "current", values, ["left"], speeds) == [-4.0, -6.0, 4.0, 3.0, 3.0, 3.0]
    assert braked(PARAMETERS, "current", values, [], speeds) == values


def test_caster_has_no_command_and_does_not_count_in_odometry() -> None:
    caster = Wheel("C", (-0.6, 0.0, 0.13), 0.13, 0.05, 0.5, friction_scale=0.0, motor=NO_MOTOR)
    vehicle = replace(PARAMETERS.vehicle, wheels=(caster, *PARAMETERS.vehicle.wheels))
    parameters = replace(PARAMETERS, vehicle=vehicle)
    values = side_values(parameters, "current", Sides(0.5, 1.0))
    assert values == side_values(PARAMETERS, "current", Sides(0.5, 1.0))
    stopped = braked(parameters, "current", values, ["left"], [2.0] * 6)
    assert stopped == braked(PARAMETERS, "current", values, ["left"], [2.0] * 6)
    odometry = WheelOdometry(parameters)
    for turned_rad in (0.0, 1.0):
        odometry.update([turned_rad] * 6, 0.0, 0.0, turned_rad)
    assert odometry.position_m == pytest.approx((0.13 - PARAMETERS.tyre_m, 0.0))


def test_heading_follows_the_stick_and_not_the_rover() -> None:
    loop = HeadingLoop()
    for _ in range(10):  # it does not turn at all
        asked = loop.turn_radps(0.2, 1.0, 0.1)
    assert loop.heading_rad == pytest.approx(1.2)
    assert asked == pytest.approx(0.2 + 0.2)
    assert loop.turn_radps(0.0, 1.3, 0.1) == pytest.approx(-0.1)


def test_heading_does_not_run_away_from_a_rover_that_is_stuck() -> None:
    loop = HeadingLoop()
    for _ in range(1000):
        asked = loop.turn_radps(0.8, 3.0, 0.1)
    assert asked == pytest.approx(0.8 + 0.5)
    assert loop.heading_rad == pytest.approx(wrap_rad(3.5))


# -- odometry -------------------------------------------------------------------------------------------------------


def test_odometry_along_a_circle_ends_where_it_began() -> None:
    odometry = WheelOdometry(PARAMETERS)
    rolling_m, radius_m, steps = 0.13 - PARAMETERS.tyre_m, 2.0, 400
    for i in range(steps + 1):
        angle = 2.0 * math.pi * i / steps
        odometry.update([radius_m * angle / rolling_m] * 6, wrap_rad(angle), 0.0, 0.05 * i)
        if i == steps // 4:
            assert odometry.position_m == pytest.approx((2.0, 2.0), abs=1e-3)
    assert odometry.position_m == pytest.approx((0.0, 0.0), abs=1e-6)
    assert odometry.way_m == pytest.approx(4.0 * math.pi)
    assert odometry.speed_mps == pytest.approx(4.0 * math.pi / 20.0)


def test_odometry_on_a_slope_counts_the_level_way() -> None:
    odometry = WheelOdometry(PARAMETERS)
    for i in range(2):
        odometry.update([10.0 * i] * 6, 0.0, -0.5, 0.05 * i)
    assert odometry.position_m == pytest.approx((1.255 * math.cos(0.5), 0.0))
    assert odometry.way_m == pytest.approx(1.255)


@pytest.mark.parametrize("factor", [1.2, 3.1])
def test_track_factor_is_learned_in_curves_and_kept_on_straights(factor: float) -> None:
    odometry, rolling_m, track_m = WheelOdometry(PARAMETERS), 0.13 - PARAMETERS.tyre_m, 0.76
    assert odometry.track_factor == EFFECTIVE_TRACK
    for i in range(400):
        turned = 0.5 * factor * track_m * 0.02 * i / rolling_m
        odometry.update([-turned] * 3 + [turned] * 3, wrap_rad(0.02 * i), 0.0, 0.05 * i)
    assert odometry.track_factor == pytest.approx(factor, rel=0.02)
    learned = odometry.track_factor
    odometry.update([9.0] * 6, wrap_rad(0.02 * 399), 0.0, 0.05 * 400)
    assert odometry.track_factor == learned


# In a curve the wheels slip a little along their way, too, which they cannot measure.
@pytest.mark.parametrize(("turn_radps", "allowed"), [(0.0, 0.005), (0.15, 0.03), (-0.3, 0.03)])
def test_odometry_follows_the_plant_that_has_begun_to_move(turn_radps: float, allowed: float) -> None:
    rover, odometry = Rover(PARAMETERS.vehicle, flat(), lambda seed: RoverStart()), WheelOdometry(PARAMETERS)
    rover.write("drive", DriveCommand("speed", wheel_rates(PARAMETERS, 0.8, turn_radps)))
    for i in range(1501):
        if i == 500:
            begin = rover.read("pose").position_m
        if i >= 500 and i % 25 == 0:
            _, pitch, yaw = roll_pitch_yaw_rad(rover.read("pose").attitude)
            turned = [rover.read(f"motor_{wheel.name}").turned_rad for wheel in PARAMETERS.vehicle.wheels]
            odometry.update(turned, yaw, pitch, rover.time_s)
        rover.step(rover.step_s)
    moved = [b - a for a, b in zip(begin, rover.read("pose").position_m, strict=True)][:2]
    assert odometry.way_m > 1.2
    assert math.dist(odometry.position_m, moved) < allowed * odometry.way_m
