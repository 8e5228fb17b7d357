import math
from itertools import pairwise

import pytest

from snr_sim.prelude.errors import ParameterError
from snr_sim.std_mods.slew import SlewRateLimiter, approach


def test_slow_change_passes_unlimited() -> None:
    slew = SlewRateLimiter(10.0, [1.0, 2.0])
    assert slew.update([1.05, 1.92], 0.01) == [1.05, 1.92]


def test_step_takes_its_size_divided_by_limit() -> None:
    slew = SlewRateLimiter(8.0, [0.0])
    course = [slew.update([4.0], 0.1)[0] for _ in range(7)]
    assert course == pytest.approx([0.8, 1.6, 2.4, 3.2, 4.0, 4.0, 4.0])


def test_all_values_move_by_the_same_fraction() -> None:
    slew = SlewRateLimiter(10.0, [0.0, 5.0, -3.0])
    goal = [40.0, -5.0, -3.0]
    for k in range(1, 40):
        values = slew.update(goal, 0.1)
        assert values == pytest.approx([k, 5.0 - 0.25 * k, -3.0])


def test_reset_restores_start() -> None:
    slew = SlewRateLimiter(1.0, [2.0])
    slew.update([9.0], 3.0)
    slew.reset()
    assert slew.update([9.0], 1.0) == [3.0]


@pytest.mark.parametrize("limit", [0.0, -1.0, math.nan])
def test_invalid_limits_are_rejected(limit: float) -> None:
    with pytest.raises(ParameterError, match="slew limit"):
        SlewRateLimiter(limit, [0.0])


@pytest.mark.parametrize(
    ("values", "dt_s"), [([1.0], 0.1), ([1.0, math.nan], 0.1), ([1.0, 2.0], -0.1), ([1.0, 2.0], math.nan)]
)
def test_non_finite_values_are_rejected_and_keep_state(values: list[float], dt_s: float) -> None:
    slew = SlewRateLimiter(1.0, [0.0, 0.0])
    with pytest.raises(ParameterError, match="slew limit"):
        slew.update(values, dt_s)
    assert slew.values == [0.0, 0.0]


@pytest.mark.parametrize("way", [3.0, -3.0])
def test_setpoint_moves_at_speed_and_brakes_to_target(way: float) -> None:
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
