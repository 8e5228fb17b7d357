"""The explorer on two driven wheels, against closed forms: ways, arcs, sliding, walls, echoes, people."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from snr_sim.plants.ground.diff_drive_2d import MANNERS_M, DiffDrive2D
from snr_sim.plants.ground.explorer import DriveStart, Explorer
from snr_sim.plants.ground.room import Outline, Room, Walker
from snr_sim.plants.ground.room_space import WALL_RADIUS_M
from snr_sim.plants.ground.traction import GRAVITY_MPS2
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import EchoReading, MotorCommand, TouchReading, WheelReading

EXPLORER = Explorer(
    mass_kg=0.7,
    inertia_kgm2=0.004,
    size_m=(0.2, 0.16),
    height_m=0.08,
    axle_m=-0.03,
    caster_m=0.08,
    track_m=0.12,
    wheel_radius_m=0.028,
    full_speed_mps=0.8,
    lag_s=0.06,
    grip=0.9,
    wall_friction=0.3,
    echo_range_m=2.55,
    echo_half_angle_rad=math.radians(10.0),
    bar_m=0.008,
)
HALL = ((-9.0, -5.0), (9.0, -5.0), (9.0, 5.0), (-9.0, 5.0))


def explorer(
    start: DriveStart | None = None, room: Room | None = None, step_s: float = 0.005, **numbers: Any
) -> DiffDrive2D:
    made = start or DriveStart((0.0, 0.0)), room or Room(HALL)
    return DiffDrive2D(replace(EXPLORER, **numbers), lambda seed: made, step_s=step_s)


def drive(plant: DiffDrive2D, left: float, right: float, time_s: float) -> None:
    plant.write("motors", MotorCommand(left, right))
    for _ in range(round(time_s / plant.step_s)):
        plant.step(plant.step_s)


def axle(plant: DiffDrive2D) -> tuple[float, float]:
    """Return the middle of the axle, which rolls; the centre of mass is in front of it."""
    (x, y), back = plant.position_m, plant.explorer.axle_m
    return x + back * math.cos(plant.heading_rad), y + back * math.sin(plant.heading_rad)


def test_explorer_implements_plant() -> None:
    assert isinstance(explorer(), Plant)


def test_way_is_that_of_a_lag_of_first_order() -> None:
    plant = explorer()
    drive(plant, 50.0, 50.0, 2.0)
    expected = 0.4 * (2.0 - 0.06 * (1.0 - math.exp(-2.0 / 0.06)))
    # The start asks for more than the wheels' grip; what is lost until it rolls is less than 1 mm.
    assert plant.position_m[0] == pytest.approx(expected, abs=1e-3)
    assert plant.position_m[1] == 0.0
    assert plant.read("wheels").angle_rad == [pytest.approx(expected / 0.028)] * 2  # type: ignore[union-attr]


@pytest.mark.parametrize(("left", "right"), [(30.0, 50.0), (60.0, -10.0), (-20.0, -40.0), (-35.0, 35.0)])
def test_arc_has_radius_of_its_wheels(left: float, right: float) -> None:
    plant = explorer(lag_s=0.0, grip=10.0)
    speed, turn = 0.008 * (left + right) / 2.0, 0.008 * (right - left) / 0.12
    drive(plant, left, right, 0.1)  # until it rolls
    begin, first = axle(plant), plant.heading_rad
    drive(plant, left, right, 3.0)
    radius = speed / turn
    last = first + turn * 3.0
    expected = (
        begin[0] + radius * (math.sin(last) - math.sin(first)),
        begin[1] - radius * (math.cos(last) - math.cos(first)),
    )
    assert plant.heading_rad == pytest.approx(last, abs=1e-9)
    assert axle(plant) == (pytest.approx(expected[0], abs=1e-4), pytest.approx(expected[1], abs=1e-4))


def test_locked_wheels_slide_as_far_as_friction_lets_them() -> None:
    """Stopping distance v^2 / (2 mu g), of the weight on the driven wheels; the caster does not brake."""
    plant = explorer(lag_s=0.0, grip=0.1)
    drive(plant, 100.0, 100.0, 4.0)
    assert plant.speeds[0] == pytest.approx(0.8)
    begin = plant.position_m[0]
    drive(plant, 0.0, 0.0, 3.0)
    share = 0.08 / 0.11
    assert plant.position_m[0] - begin == pytest.approx(0.8**2 / (2.0 * 0.1 * share * GRAVITY_MPS2), rel=0.01)
    assert plant.speeds[0] == pytest.approx(0.0, abs=1e-12)


def test_acceleration_is_limited_by_grip() -> None:
    plant = explorer(lag_s=0.0, grip=0.2)
    drive(plant, 100.0, 100.0, 0.2)
    assert plant.speeds[0] == pytest.approx(0.2 * 0.08 / 0.11 * GRAVITY_MPS2 * 0.2, rel=1e-6)


def test_halving_the_step_changes_little() -> None:
    ends = []
    for step_s in (0.005, 0.0025):
        plant = explorer(step_s=step_s)
        for left, right in ((60.0, 40.0), (-30.0, 80.0), (50.0, 50.0), (0.0, 0.0)):
            drive(plant, left, right, 1.0)
        ends.append((*plant.position_m, plant.heading_rad))
    assert ends[0] == pytest.approx(ends[1], abs=4e-3)


def facing(distance_m: float, heading_rad: float = 0.0) -> tuple[DriveStart, Room]:
    """Return a start with a wall to the east at a distance from the origin of the body."""
    east = distance_m + WALL_RADIUS_M
    outline: Outline = ((-3.0, -3.0), (east, -3.0), (east, 3.0), (-3.0, 3.0))
    return DriveStart((0.0, 0.0), heading_rad), Room(outline)


def test_wall_stops_it_and_bars_are_pressed() -> None:
    plant = explorer(*facing(0.6))
    assert plant.read("touch") == TouchReading(False, False, 0.0)
    drive(plant, 50.0, 50.0, 4.0)
    assert plant.hit_mps == pytest.approx(0.4, rel=1e-3)
    assert plant.position_m[0] == pytest.approx(0.5, abs=2e-3)
    assert abs(plant.position_m[1]) < 1e-3
    assert plant.read("touch") == TouchReading(True, True, 4.0)
    drive(plant, -20.0, -20.0, 1.0)
    assert plant.read("touch") == TouchReading(False, False, 5.0)
    assert plant.position_m[0] < 0.5


def test_pushing_against_a_wall_takes_no_speed_from_nowhere() -> None:
    plant = explorer(*facing(0.6))
    drive(plant, 50.0, 50.0, 2.0)
    first = plant.hit_mps
    drive(plant, 100.0, 100.0, 5.0)
    assert plant.hit_mps == first, "pushing is not hitting"
    assert math.hypot(*plant.speeds[:2]) < 0.02


def test_wall_that_is_met_askew_turns_it_until_it_is_flush() -> None:
    plant = explorer(*facing(0.7, 0.6))
    drive(plant, 50.0, 50.0, 3.0)
    assert 0.4 * math.cos(0.6) - 0.01 < plant.hit_mps < 0.4, "one corner as it comes, the other one as it turns"
    assert plant.heading_rad == pytest.approx(0.0, abs=0.02)
    assert plant.read("touch") == TouchReading(True, True, 3.0)


@pytest.mark.parametrize("heading_deg", [0.0, 5.0, 20.0, 40.0])
def test_echo_is_from_nearest_point_of_cone(heading_deg: float) -> None:
    heading = math.radians(heading_deg)
    plant = explorer(*facing(1.5, heading))
    sensor_x = 0.1 * math.cos(heading)
    # The ray of the cone that meets the wall most squarely.
    nearest = max(0.0, heading - math.radians(10.0))
    reading = plant.read("range")
    assert isinstance(reading, EchoReading)
    assert reading.distance_m == pytest.approx((1.5 - sensor_x) / math.cos(nearest), rel=0.002)
    assert reading.confidence == 1.0


def test_there_is_no_echo_from_far_away() -> None:
    assert explorer().read("range") == EchoReading(2.55, 0.0, 0.0)


def test_people_stop_for_a_robot_in_front_of_them_and_continue_without() -> None:
    walker = Walker((2.0, 0.0), (-2.0, 0.0), radius_m=0.2, speed_mps=0.5)
    plant = explorer(room=Room(HALL, walkers=(walker,)))
    drive(plant, 0.0, 0.0, 10.0)
    reach = 0.5 * math.hypot(0.2, 0.16)
    assert walker.place_m(plant.people_m[0])[0] == pytest.approx(reach + 0.2 + MANNERS_M, abs=0.005)
    assert plant.hit_mps == 0.0
    drive(plant, 0.0, 0.0, 5.0)
    drive(plant, -50.0, -50.0, 10.0)  # it makes room
    assert walker.place_m(plant.people_m[0])[0] < 0.0


def test_driving_into_a_person_is_a_hit() -> None:
    walker = Walker((2.0, 0.0), (-2.0, 0.0), speed_mps=0.5)
    plant = explorer(room=Room(HALL, walkers=(walker,)))
    drive(plant, 50.0, 50.0, 8.0)
    assert plant.hit_mps == pytest.approx(0.4, rel=0.01)


def test_floor_in_view_is_counted_once() -> None:
    plant = explorer(*facing(1.0))
    first = plant.seen_share
    assert 0.0 < first < 0.1
    drive(plant, 0.0, 0.0, 2.0)
    assert plant.seen_share == first
    drive(plant, -20.0, 20.0, 6.0)
    assert plant.seen_share > 0.3


def test_wheels_count_while_they_slide() -> None:
    plant = explorer(*facing(0.15))
    drive(plant, 50.0, 50.0, 3.0)
    reading = plant.read("wheels")
    assert isinstance(reading, WheelReading)
    assert reading.angle_rad[0] * 0.028 > 1.0


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"mass_kg": 700.0}, "grams"),
        ({"axle_m": 0.01}, "between them"),
        ({"echo_half_angle_rad": 10.0}, "degrees"),
        ({"grip": -1.0}, "grip"),
        ({"full_speed_mps": math.nan}, "full_speed_mps"),
    ],
)
def test_explorer_that_cannot_be_is_refused(numbers: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        replace(EXPLORER, **numbers)
    assert message in str(caught.value)


@pytest.mark.parametrize("place", [(8.95, 0.0), (25.0, 0.0)])
def test_start_outside_of_floor_is_refused(place: tuple[float, float]) -> None:
    with pytest.raises(ParameterError, match="no room"):
        explorer(DriveStart(place))


def test_unknown_names_and_steps_are_refused() -> None:
    plant = explorer()
    with pytest.raises(UnknownNameError, match="touch"):
        plant.read("tuch")
    with pytest.raises(UnknownNameError, match="motors"):
        plant.write("motor", MotorCommand())
    with pytest.raises(ParameterError, match="steps of"):
        plant.step(0.004)
    with pytest.raises(PlantError, match="not finite"):
        plant.write("motors", MotorCommand(math.nan, 0.0))
    with pytest.raises(ParameterError, match="DriveStart and a Room"):
        DiffDrive2D(EXPLORER, lambda seed: DriveStart((0.0, 0.0)))  # type: ignore[arg-type, return-value]
