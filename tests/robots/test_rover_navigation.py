"""The rover on the map: place from odometry and fixes, and the way along a route, without a plant."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.prelude.angles import wrap_rad
from snr_sim.scenario import library

library.load_robot(library.find("robots", "rover"))

from snr_sim_robot_rover.navigation import POSITION_S, SPEED_MPS, SPIN_RADPS, TURN_RADPS, Place, RouteFollower  # noqa: E402

ROUTE = [(8.0, 0.0), (8.0, 8.0), (0.0, 8.0)]


def straight(place: Place, seconds: float, compass_off_rad: float = 0.0, fix_off_m: float = 0.0) -> None:
    """Drive to the east with 1 m/s, while compass and fixes are off; the receiver's course is right."""
    for i in range(round(20.0 * seconds) + 1):
        way_m, yaw = 0.05 * i, -compass_off_rad
        place.move((way_m * math.cos(yaw), way_m * math.sin(yaw)), yaw, 1.0, 0.05 * i)
        if i % 2 == 0 and i > 0:
            place.fix((way_m + fix_off_m, 0.0), 0.0, 0.1)


def test_place_follows_odometry() -> None:
    place = Place((3.0, 4.0))
    place.move((1.0, 1.0), 0.3, 1.0, 0.0)
    place.move((3.0, 0.0), 0.3, 1.0, 0.05)
    assert place.position_m == pytest.approx((5.0, 3.0))
    assert place.heading_rad == pytest.approx(0.3)


def test_error_of_the_compass_is_learned_on_a_straight_way() -> None:
    place = Place()
    straight(place, 40.0, compass_off_rad=0.1)
    assert place.offset_rad == pytest.approx(0.1, rel=0.02)
    assert abs(place.position_m[1]) < 1.0, "without it, it were 4 m"


def test_course_counts_neither_at_rest_nor_in_a_curve() -> None:
    for speed_mps, turn_rad in ((0.0, 0.0), (1.0, 0.02)):
        place = Place()
        for i in range(100):
            place.move((0.0, 0.0), turn_rad * i, speed_mps, 0.05 * i)
            if i > 0:
                place.fix((0.0, 0.0), 2.0, 0.05)
        assert place.offset_rad == 0.0


def test_fixes_pull_the_place_slowly() -> None:
    place = Place()
    straight(place, 20.0, fix_off_m=5.0)
    assert place.position_m[0] - 20.0 == pytest.approx(5.0 * (1.0 - math.exp(-20.0 / 200.0)), rel=0.02)


@given(st.floats(-math.pi, math.pi), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_route_is_driven_from_any_heading_near_its_start(heading: float, x: float, y: float) -> None:
    follower, time_s, speed, turn, nearest = RouteFollower(ROUTE), 0.0, 0.0, 0.0, [math.inf] * 3
    while not follower.has_arrived:
        speed, turn = follower.steer((x, y), heading, speed)
        assert speed in (0.0, SPEED_MPS)
        assert abs(turn) <= (TURN_RADPS if speed else SPIN_RADPS)
        x, y = x + 0.1 * speed * math.cos(heading), y + 0.1 * speed * math.sin(heading)
        heading, time_s = wrap_rad(heading + 0.1 * turn), time_s + 0.1
        nearest = [min(near, math.dist(point, (x, y))) for near, point in zip(nearest, ROUTE, strict=True)]
        assert time_s < 60.0
    assert max(nearest) < 1.0
    assert follower.steer((x, y), heading, 0.0) == (0.0, 0.0)


def test_rover_that_drives_stops_before_it_turns_on_the_spot() -> None:
    follower = RouteFollower([(10.0, 0.0)])
    assert follower.steer((0.0, 0.0), 1.5, speed_mps=1.2) == (0.0, 0.0)
    assert follower.steer((0.0, 0.0), 1.5, speed_mps=0.02) == (0.0, -SPIN_RADPS)
    assert follower.steer((0.0, 0.0), 0.2, speed_mps=0.3) == (0.0, pytest.approx(-0.3)), "it has begun, and continues"
    assert follower.steer((0.0, 0.0), 0.05, speed_mps=0.0)[0] == SPEED_MPS


def test_way_that_is_left_is_counted_along_the_line() -> None:
    follower = RouteFollower(ROUTE)
    assert follower.left_m((4.0, 1.0)) == pytest.approx(4.0)
    follower.steer((7.9, 2.0), 0.0, 0.0)
    assert follower.reached == 1
    assert follower.left_m((8.0, 2.5)) == pytest.approx(5.5)


def test_point_that_is_there_twice_is_reached_with_the_one_before() -> None:
    follower = RouteFollower([(0.0, 0.0), (8.0, 0.0), (8.0, 0.0), (8.0, 8.0)])
    assert follower.steer((0.0, 0.5), 0.0, 0.0)[0] == SPEED_MPS
    assert (follower.reached, follower.left_m((0.0, 0.5))) == (1, 8.0)
    follower.steer((7.9, 0.0), 0.0, 0.0)
    assert follower.reached == 3


def test_fix_without_a_course_corrects_the_position_alone() -> None:
    place = Place()
    straight(place, 1.0)
    (x, y), offset_rad = place.position_m, place.offset_rad
    place.fix((x, y + POSITION_S), None, 0.1)
    assert place.position_m == pytest.approx((x, y + 0.1))
    assert place.offset_rad == offset_rad
