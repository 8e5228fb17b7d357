"""The rover among boulders, cut off, and without a receiver: choice of a heading, dead reckoning, whole runs."""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.recording.reader import read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from tests.lanes import slow
from tests.scenarios.recorded import simulate

library.load_robot(library.find("robots", "rover"))

from snr_sim_robot_rover.avoid import (  # noqa: E402
    BEHIND_M,
    LOOK_M,
    NARROW_M,
    WIDE_M,
    free_heading,
    is_free,
    points_of,
)
from snr_sim_robot_rover.navigation import DeadReckoning  # noqa: E402

PLACES = st.lists(st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)), max_size=12)


@given(PLACES, st.floats(-math.pi, math.pi), st.floats(0.6, 40.0), st.floats(-2.0, 2.0))
def test_heading_that_is_taken_has_a_free_lane(
    places: list[tuple[float, float]], goal_rad: float, goal_m: float, before_rad: float
) -> None:
    heading = free_heading(places, goal_rad, goal_m, before_rad)
    if heading is None:
        assert places
        return
    look_m = min(LOOK_M, goal_m)
    turn = complex(math.cos(heading), -math.sin(heading))
    for x, y in places:
        seen = turn * complex(x, y)
        assert not (-BEHIND_M < seen.real < look_m and abs(seen.imag) < NARROW_M)


@given(st.floats(-2.0, 2.0), st.floats(0.6, 40.0))
def test_goal_is_driven_to_where_nothing_is_in_the_way(goal_rad: float, goal_m: float) -> None:
    assert free_heading([], goal_rad, goal_m, goal_rad) == goal_rad


def test_boulder_ahead_is_passed_with_room_and_on_the_side_that_was_chosen_before() -> None:
    boulder = [(2.5, 0.1 * i) for i in range(-4, 5)]
    left, right = (free_heading(boulder, 0.0, 20.0, before) for before in (0.4, -0.4))
    assert left is not None
    assert right == pytest.approx(-left)
    assert left > 0.0
    assert is_free(boulder, left, WIDE_M, LOOK_M)


def test_gate_that_is_just_wide_enough_is_driven_through() -> None:
    gate = [(2.0, side * (NARROW_M + 0.1) + 0.2 * i * side) for side in (-1, 1) for i in range(20)]
    heading = free_heading(gate, 0.0, 20.0, 0.0)
    assert heading is not None
    assert abs(heading) < 0.1


def test_rover_that_is_walled_in_has_no_heading() -> None:
    ring = [(1.2 * math.cos(0.1 * i), 1.2 * math.sin(0.1 * i)) for i in range(63)]
    assert free_heading(ring, 0.0, 20.0, 0.0) is None


def test_rays_without_an_echo_give_no_points() -> None:
    assert points_of([1.0, 8.0, 2.0], [0.0, 0.5, math.pi / 2.0], 8.0) == [(1.0, 0.0), pytest.approx((0.0, 2.0))]


def test_dead_reckoning_stands_until_it_knows_the_bias_and_then_goes_round() -> None:
    rng, place = random.Random(3), DeadReckoning(3.0)
    for i in range(50 * 23):
        turns = 0.1 * math.pi if i >= 150 else 0.0
        place.turn(turns + 0.02 + rng.gauss(0.0, 0.002), 0.02 * i)
        assert place.move(1.0 if i >= 150 else 0.0, 0.02 * i) == (i >= 150)
    assert abs(place.heading_rad) < 0.05, "a whole turn"
    assert math.hypot(*place.position_m) < 0.3, "20 m around"


@pytest.mark.parametrize("run", ["rover_lost_link pymunk 0", slow("rover_lost_link mujoco 0")])
def test_rover_stops_on_the_slope_when_its_link_is_cut_and_is_driven_home_later(run: str, tmp_path: Path) -> None:
    result = simulate(run, tmp_path)
    assert (result.outcome, result.success) == ("home", True)
    assert result.metrics["rolled_s"] <= 0.3
    assert result.metrics["back_m"] < 0.05
    assert result.metrics["way_m"] > 0.5
    trace = read_trace(tmp_path / FILE_NAME)
    for node in ("rover", "topside"):
        assert replay_node(trace, node, prepare(Request("rover_lost_link")).config(None)).is_identical


@pytest.mark.slow
@pytest.mark.parametrize("run", ["rover_obstacle pymunk 0", "rover_obstacle mujoco 0"])
def test_rover_drives_between_boulders_to_its_goal(run: str, tmp_path: Path) -> None:
    result = simulate(run, tmp_path)
    assert (result.outcome, result.success) == ("arrived", True)
    assert result.metrics["hardest_n"] == 0.0
    assert 29.0 < result.metrics["way_m"] < 45.0
