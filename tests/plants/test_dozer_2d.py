"""The tracked vehicle and its soil, against closed forms: ways, arcs, pull, turning, friction of stones, walls."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.plants.ground.dozer import MAX_STONES, Dozer, Heap
from snr_sim.plants.ground.dozer_2d import SOIL_STEPS, Dozer2D
from snr_sim.plants.ground.explorer import DriveStart
from snr_sim.plants.ground.room import Point, Room, Walker
from snr_sim.plants.ground.soil import Push, Soil
from snr_sim.plants.ground.traction import GRAVITY_MPS2
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import DozerCommand, ViewReading

DOZER = Dozer(
    mass_kg=12.0,
    inertia_kgm2=0.5,
    size_m=(0.60, 0.42),
    height_m=0.24,
    track_m=0.34,
    track_length_m=0.40,
    full_speed_mps=0.30,
    lag_s=0.10,
    max_pull_n=60.0,
    grip_along=0.8,
    grip_across=0.5,
    wall_friction=0.4,
    blade_s=0.5,
)
RADIUS, STONE_KG, FRICTION = 0.03, 0.15, 0.6
STONE_N = FRICTION * STONE_KG * GRAVITY_MPS2
HALL = ((-9.0, -5.0), (9.0, -5.0), (9.0, 5.0), (-9.0, 5.0))
BROWN = (150, 105, 60)


def heap(*places: Point, edge_m: float = 8.0) -> Heap:
    places = places or ((0.0, 4.0),)
    return Heap(places, (BROWN,) * len(places), edge_m, RADIUS, STONE_KG, FRICTION)


def dozer(
    stones: Heap | None = None, start: DriveStart | None = None, room: Room | None = None, **numbers: Any
) -> Dozer2D:
    made = start or DriveStart((0.0, 0.0)), room or Room(HALL), stones or heap()
    return Dozer2D(replace(DOZER, **numbers), lambda seed: made)


def drive(plant: Dozer2D, left: float, right: float, time_s: float, blade: float = 0.0) -> None:
    plant.write("dozer", DozerCommand(left, right, blade))
    for _ in range(round(time_s / plant.step_s)):
        plant.step(plant.step_s)


def line(count: int, ahead_m: float = 0.4) -> list[Point]:
    """Return stones one behind the other, in front of the blade's middle."""
    return [(ahead_m + 2.0 * RADIUS * i, 0.0) for i in range(count)]


def test_dozer_implements_plant() -> None:
    assert isinstance(dozer(), Plant)


# -- tracks -----------------------------------------------------------------------------------------------------------


def test_way_is_that_of_a_lag_of_first_order() -> None:
    plant = dozer(max_pull_n=1000.0, grip_along=10.0)
    drive(plant, 0.2, 0.2, 2.0)
    assert plant.position_m[0] == pytest.approx(0.2 * (2.0 - 0.1 * (1.0 - math.exp(-2.0 / 0.1))), rel=1e-6)
    assert abs(plant.position_m[1]) < 1e-12


@pytest.mark.parametrize(("left", "right"), [(0.1, 0.2), (0.25, -0.05), (-0.1, -0.2), (-0.15, 0.15)])
def test_arc_is_that_of_the_tracks_speeds_if_they_grip(left: float, right: float) -> None:
    """Skid steering: the radius is half the track times (right + left) / (right - left)."""
    plant = dozer(lag_s=0.0, grip_along=10.0, max_pull_n=1000.0)
    drive(plant, left, right, 0.1)
    turn, ahead = (right - left) / 0.34, 0.5 * (left + right)
    first = plant.heading_rad
    drive(plant, left, right, 2.0)
    assert plant.heading_rad - first == pytest.approx(2.0 * turn, rel=1e-6)
    speed = math.hypot(*plant.speeds[:2])
    assert speed == pytest.approx(abs(ahead), rel=1e-3, abs=1e-4)


def test_pull_ends_at_friction_and_at_the_motors() -> None:
    for numbers, pull_n in (({"max_pull_n": 30.0}, 60.0), ({"grip_along": 0.2}, 0.2 * 12.0 * GRAVITY_MPS2)):
        plant = dozer(lag_s=0.0, full_speed_mps=3.0, **numbers)
        drive(plant, 3.0, 3.0, 0.1)
        assert plant.speeds[0] == pytest.approx(0.1 * pull_n / 12.0, rel=1e-6)


def test_way_to_a_stop_is_that_of_friction() -> None:
    plant = dozer(lag_s=0.0, full_speed_mps=2.0, grip_along=0.3, max_pull_n=1000.0)
    drive(plant, 2.0, 2.0, 2.0)
    start = plant.position_m[0]
    drive(plant, 0.0, 0.0, 2.0)
    assert plant.speeds == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert plant.position_m[0] - start == pytest.approx(2.0**2 / (2.0 * 0.3 * GRAVITY_MPS2), rel=0.01)


@pytest.mark.parametrize(("share", "turns"), [(0.95, False), (1.1, True)])
def test_turning_on_the_spot_needs_the_moment_of_a_line_of_even_pressure(share: float, turns: bool) -> None:
    """Friction * weight * length / 4 resists; the tracks give pull * track."""
    resisting_nm = 0.5 * 12.0 * GRAVITY_MPS2 * 0.40 / 4.0
    plant = dozer(lag_s=0.0, max_pull_n=share * resisting_nm / 0.34)
    drive(plant, -0.3, 0.3, 1.0)
    assert (plant.heading_rad > 0.01) == turns


def test_without_friction_across_it_slides_on_sideways() -> None:
    plant = dozer(grip_across=0.0)
    plant.restore(plant.snapshot()._replace(speeds=(0.0, 0.5, 0.0)))
    drive(plant, 0.0, 0.0, 1.0)
    assert plant.position_m[1] == pytest.approx(0.5, rel=1e-9)


# -- soil -------------------------------------------------------------------------------------------------------------


def test_blade_up_moves_nothing_and_down_pushes_what_is_in_front() -> None:
    up, down = dozer(heap(*line(3))), dozer(heap(*line(3)))
    drive(up, 0.2, 0.2, 4.0)
    drive(down, 0.0, 0.0, 0.6, blade=1.0)
    drive(down, 0.2, 0.2, 4.0, blade=1.0)
    assert up.stones_m == tuple(line(3))
    front = down.position_m[0] + 0.3
    assert [x - front for x, _ in down.stones_m] == pytest.approx([0.03, 0.09, 0.15], abs=0.2 * SOIL_STEPS * 0.005)
    assert down.position_m[0] == pytest.approx(up.position_m[0], abs=1e-3)  # three stones are nothing to it


def test_blade_feels_the_friction_of_all_that_it_moves() -> None:
    plant = dozer(heap(*line(10)))
    drive(plant, 0.0, 0.0, 0.6, blade=1.0)
    drive(plant, 0.1, 0.1, 3.0, blade=1.0)
    assert plant.push == Push(pytest.approx(10 * STONE_N), pytest.approx(0.0, abs=1e-6))  # type: ignore[arg-type]


@pytest.mark.parametrize(("stones", "stalls"), [(8, False), (12, True)])
def test_vehicle_stalls_at_as_much_soil_as_its_motors_can_push(stones: int, stalls: bool) -> None:
    plant = dozer(heap(*line(stones, 0.34)), max_pull_n=5.0 * STONE_N)  # two tracks: ten stones
    drive(plant, 0.0, 0.0, 0.6, blade=1.0)
    drive(plant, 0.2, 0.2, 5.0, blade=1.0)
    assert (plant.position_m[0] < 0.3) == stalls


def test_soil_at_the_left_turns_the_vehicle_to_the_left() -> None:
    rows = [(x, y) for x in (0.4, 0.46, 0.52) for y in (0.1, 0.16)]
    plant = dozer(heap(*rows), lag_s=0.0, max_pull_n=6.0)
    drive(plant, 0.0, 0.0, 0.6, blade=1.0)
    drive(plant, 0.2, 0.2, 3.0, blade=1.0)
    assert plant.heading_rad >= 0.0
    assert plant.push.arm_m > 0.05


def test_stones_beyond_the_edge_have_fallen_and_are_neither_seen_nor_moved() -> None:
    plant = dozer(heap(*line(4), edge_m=0.8))
    drive(plant, 0.0, 0.0, 0.6, blade=1.0)
    drive(plant, 0.2, 0.2, 5.0, blade=1.0)
    assert plant.cleared_share == 1.0
    view = plant.read("view")
    assert isinstance(view, ViewReading)
    assert view.balls == []
    assert all(plant.truth()["poses"][f"stone_{i}"][2] < 0.0 for i in range(4))
    assert plant.push == Push()


places = st.tuples(st.floats(-0.3, 0.5), st.floats(-0.4, 0.4))


@given(st.lists(places, min_size=1, max_size=30), st.floats(-math.pi, math.pi))
def test_stones_that_are_pushed_leave_the_blade_and_none_comes_nearer(stones: list[Point], heading: float) -> None:
    """Whatever lies in front of it: after a push no stone is in the blade, and all that moved have moved away from it
    or aside."""
    soil = Soil(heap(*stones, edge_m=40.0), 0.42)
    cos, sin = math.cos(heading), math.sin(heading)
    world = tuple((cos * x - sin * y, sin * x + cos * y) for x, y in stones)
    for _ in range(50):  # stones that others have pushed back into the blade are moved by the next push
        after, push = soil.push(world, (0.0, 0.0), heading)
        assert all(map(math.isfinite, (*push, *(value for place in after for value in place))))
        assert push.force_n == pytest.approx(
            STONE_N * sum(a != b for a, b in zip(world, after, strict=True)), abs=1e-9
        )  # exact: integers
        if after == world:
            break
        world = after
    ahead = [(cos * x + sin * y, cos * y - sin * x) for x, y in world]
    deep = [x for x, y in ahead if -RADIUS < x < RADIUS - 1e-6 and abs(y) < 0.21]
    assert deep == []


# -- walls, being put back, being wrong -------------------------------------------------------------------------------


def test_wall_stops_it_at_the_speed_that_is_noted() -> None:
    plant = dozer(room=Room(((-2.0, -2.0), (1.0, -2.0), (1.0, 2.0), (-2.0, 2.0))))
    drive(plant, 0.2, 0.2, 6.0)
    assert plant.hit_mps == pytest.approx(0.2, rel=0.02)
    assert plant.position_m[0] + 0.3 == pytest.approx(0.99, abs=0.003)


def test_restored_state_continues_bitwise() -> None:
    plant = dozer(heap(*line(8)), room=Room(((-2.0, -2.0), (1.4, -2.0), (1.4, 2.0), (-2.0, 2.0))))
    drive(plant, 0.0, 0.0, 0.4, blade=1.0)
    drive(plant, 0.2, 0.25, 2.0, blade=1.0)
    kept = plant.snapshot()
    drive(plant, 0.3, 0.25, 3.0, blade=1.0)
    once = plant.snapshot()
    plant.restore(kept)
    drive(plant, 0.3, 0.25, 3.0, blade=1.0)
    assert plant.snapshot() == once


def test_speeds_and_blade_are_clamped() -> None:
    plant = dozer()
    plant.write("dozer", DozerCommand(9.0, -9.0, 7.0))
    assert (plant.goals_mps, plant.blade_goal) == ((0.3, -0.3), 1.0)


def test_wrong_names_steps_and_numbers_raise() -> None:
    plant = dozer()
    with pytest.raises(UnknownNameError, match="no input 'doser'"):
        plant.write("doser", DozerCommand())
    with pytest.raises(UnknownNameError, match="no output 'sight'"):
        plant.read("sight")
    with pytest.raises(PlantError, match="not finite"):
        plant.write("dozer", DozerCommand(left_mps=math.nan))
    with pytest.raises(ParameterError, match=r"steps of 0\.005 s"):
        plant.step(0.01)
    plant.restore(plant.snapshot()._replace(position_m=(math.nan, 0.0)))
    with pytest.raises(PlantError, match="no longer finite"):
        plant.step(plant.step_s)


def test_impossible_starts_and_heaps_raise() -> None:
    with pytest.raises(ParameterError, match="has no room"):
        dozer(start=DriveStart((8.9, 0.0)))
    with pytest.raises(ParameterError, match="people"):
        dozer(room=Room(HALL, walkers=(Walker((0.0, 2.0), (1.0, 2.0)),)))
    with pytest.raises(ParameterError, match="a DriveStart, a Room and a Heap"):
        Dozer2D(DOZER, lambda seed: (DriveStart((0.0, 0.0)), Room(HALL)))  # type: ignore[arg-type, return-value]
    with pytest.raises(ParameterError, match="1 stones and 0 colors"):
        Heap(((0.0, 0.0),), (), 1.0, RADIUS, STONE_KG, FRICTION)
    with pytest.raises(ParameterError, match=f"1 to {MAX_STONES}"):
        heap(*[(0.0, 0.0)] * (MAX_STONES + 1))
    with pytest.raises(ParameterError, match="stone's place"):
        heap((0.0, math.nan))
