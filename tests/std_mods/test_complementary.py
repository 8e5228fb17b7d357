"""The complementary filter against closed forms."""

import math

import numpy as np
import pytest

from snr_sim.prelude.errors import ParameterError
from snr_sim.std_mods.complementary import ComplementaryFilter


@pytest.mark.parametrize("dt_s", [0.002, 0.02, 0.2, 5.0])
def test_step_of_measured_value_is_tracked_with_time_constant(dt_s: float) -> None:
    smooth = ComplementaryFilter(time_constant_s=2.0)
    smooth.update(0.0, 0.0, dt_s)
    for k in range(1, 20):
        assert smooth.update(0.0, 1.0, dt_s) == pytest.approx(1.0 - math.exp(-k * dt_s / 2.0))


def test_a_bias_of_the_rate_leaves_bias_times_time_constant_and_no_drift() -> None:
    smooth = ComplementaryFilter(time_constant_s=2.0)
    for _ in range(20_000):
        estimate = smooth.update(0.01, 0.0, 0.001)
    assert estimate == pytest.approx(0.02, rel=0.001)


def test_motion_at_measured_rate_is_tracked_without_delay() -> None:
    smooth = ComplementaryFilter(time_constant_s=2.0)
    for k in range(2000):
        t = 0.001 * k
        estimate = smooth.update(3.0 * math.cos(3.0 * (t - 0.0005)), math.sin(3.0 * t), 0.001)
        assert estimate == pytest.approx(math.sin(3.0 * t), abs=1e-5)


def test_noise_of_the_steady_measurement_is_reduced_as_by_a_first_order_low_pass() -> None:
    rng, smooth, dt = np.random.default_rng(1), ComplementaryFilter(time_constant_s=1.0), 0.01
    estimates = [smooth.update(0.0, float(noise), dt) for noise in rng.standard_normal(200_000)]
    share = -math.expm1(-dt)
    assert np.std(estimates[1000:]) == pytest.approx(math.sqrt(share / (2.0 - share)), rel=0.1)


def test_an_angle_is_pulled_the_shorter_way_round_and_stays_within_half_a_turn() -> None:
    smooth = ComplementaryFilter(time_constant_s=1.0, is_angle=True)
    smooth.update(0.0, 3.1, 0.1)
    estimates = [smooth.update(0.0, -3.1, 0.1) for _ in range(50)]
    assert all(abs(estimate) > 3.05 for estimate in estimates)
    assert estimates[-1] == pytest.approx(-3.1, abs=0.01)


def test_first_value_after_reset_becomes_estimate() -> None:
    smooth = ComplementaryFilter(time_constant_s=100.0)
    smooth.update(0.0, 5.0, 0.1)
    smooth.reset()
    assert smooth.update(0.0, -5.0, 0.1) == -5.0


@pytest.mark.parametrize("time_constant_s", [0.0, -1.0, math.nan, math.inf])
def test_invalid_time_constants_are_rejected(time_constant_s: float) -> None:
    with pytest.raises(ParameterError, match="time_constant_s"):
        ComplementaryFilter(time_constant_s)


@pytest.mark.parametrize("values", [(math.nan, 0.0, 0.1), (0.0, math.inf, 0.1), (0.0, 0.0, -0.1)])
def test_non_finite_values_are_rejected(values: tuple[float, float, float]) -> None:
    with pytest.raises(ParameterError, match="complementary filter got"):
        ComplementaryFilter(1.0).update(*values)
