import math
from itertools import pairwise

import pytest

from snr_sim.prelude.errors import ParameterError
from snr_sim.std_mods.slew import SlewLimit, approach


def test_what_is_slow_enough_passes_as_it_is() -> None:
    slew = SlewLimit(10.0, [1.0, 2.0])
    assert slew.update([1.05, 1.92], 0.01) == [1.05, 1.92]


def test_a_step_is_reached_after_its_length_over_the_limit() -> None:
    slew = SlewLimit(8.0, [0.0])
    course = [slew.update([4.0], 0.1)[0] for _ in range(7)]
    assert course == pytest.approx([0.8, 1.6, 2.4, 3.2, 4.0, 4.0, 4.0])


def test_all_values_take_the_same_share_of_their_way() -> None:
    slew = SlewLimit(10.0, [0.0, 5.0, -3.0])
    goal = [40.0, -5.0, -3.0]
    for k in range(1, 40):
        values = slew.update(goal, 0.1)
        assert values == pytest.approx([k, 5.0 - 0.25 * k, -3.0])


def test_reset_goes_back_to_the_start() -> None:
    slew = SlewLimit(1.0, [2.0])
    slew.update([9.0], 3.0)
    slew.reset()
    assert slew.update([9.0], 1.0) == [3.0]


@pytest.mark.parametrize("limit", [0.0, -1.0, math.nan])
def test_limits_that_make_no_sense_are_refused(limit: float) -> None:
    with pytest.raises(ParameterError, match="slew limit"):
        SlewLimit(limit, [0.0])


@pytest.mark.parametrize(
    ("values", "dt_s"), [([1.0], 0.1), ([1.0, math.nan], 0.1), ([1.0, 2.0], -0.1), ([1.0, 2.0], math.nan)]
)
def test_values_that_are_none_are_refused_and_change_nothing(values: list[float], dt_s: float) -> None:
    slew = SlewLimit(1.0, [0.0, 0.0])
    with pytest.raises(ParameterError, match="slew limit"):
        slew.update(values, dt_s)
    assert slew.values == [0.0, 0.0]


@pytest.mark.parametrize("way", [3.0, -3.0])
def test_a_setpoint_goes_at_its_speed_and_brakes_evenly_and_arrives(way: float) -> None:
    """Braking by b from a speed v takes v / b, and the way v^2 / 2 b: that is the closed form of the whole."""
    at, course = 0.0, [0.0]
    while abs(way - at) > 1e-6:
        at += approach(way - at, speed=0.5, brake=0.1, dt_s=0.01)
        course.append(at)
    speeds = [abs(b - a) / 0.01 for a, b in pairwise(course)]
    assert max(speeds) == pytest.approx(0.5)
    assert len(course) * 0.01 == pytest.approx((3.0 - 0.5**2 / 0.2) / 0.5 + 0.5 / 0.1, abs=0.3)
    assert max(abs(at) for at in course) <= 3.0
    assert max(a - b for a, b in pairwise(speeds[:-30])) == pytest.approx(0.1 * 0.01, rel=0.1)
