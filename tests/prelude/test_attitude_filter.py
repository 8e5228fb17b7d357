"""The attitude against closed forms: at rest, turning, with a bias, and near iron."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from snr_sim.prelude.angles import quaternion_of, roll_pitch_yaw_rad, wrap_rad
from snr_sim.prelude.attitude_filter import MahonyFilter, Quaternion, attitude_at_rest, into_world

DEG = math.radians(1.0)
NORTH_UT = (0.0, 20.0, -40.0)  # and down, as in Europe
UP = (0.0, 0.0, 9.80665)


def measurement_of(attitude: Quaternion) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Force and field in the body's axes."""
    w, x, y, z = attitude
    back = (w, -x, -y, -z)
    return into_world(back, UP), into_world(back, NORTH_UT)


def final_errors_deg(
    truth: Callable[[float], Quaternion], rate: tuple[float, ...], seconds: float
) -> tuple[float, ...]:
    """Run a filter at 100 Hz; return how far roll, pitch and yaw are off [deg] in the end."""
    one = MahonyFilter()
    attitude = (1.0, 0.0, 0.0, 0.0)
    for i in range(round(seconds * 100)):
        attitude = one.update(rate, *measurement_of(truth(i / 100)), i / 100)
    estimate, true = roll_pitch_yaw_rad(attitude), roll_pitch_yaw_rad(truth(seconds - 0.01))
    return tuple(math.remainder(a - b, math.tau) / DEG for a, b in zip(estimate, true, strict=True))


def test_attitude_at_rest_equals_gravity_and_field() -> None:
    angles = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, -0.4, 1.0), (-0.2, 0.5, -3.0), (3.0, 0.1, 2.0)]
    for one in [*angles, *np.random.default_rng(2).uniform((-3.0, -1.4, -3.1), (3.0, 1.4, 3.1), (40, 3)).tolist()]:
        at_rest = measurement_of(quaternion_of(*one))
        assert roll_pitch_yaw_rad(attitude_at_rest(*at_rest)) == pytest.approx(tuple(one), abs=1e-9)
        assert MahonyFilter().update((0.0, 0.0, 0.0), *at_rest, 0.01) == attitude_at_rest(*at_rest)


def test_declination_shifts_heading_at_start_and_later() -> None:
    """The field points 0.1 rad to the east of north, so what it calls 0.4 is 0.3."""
    one, still = MahonyFilter(declination_rad=0.1), measurement_of(quaternion_of(0.0, 0.0, 0.4))
    assert roll_pitch_yaw_rad(one.update((0.0, 0.0, 0.0), *still, 0.0))[2] == pytest.approx(0.3)
    assert roll_pitch_yaw_rad(one.update((0.0, 0.0, 0.0), *still, 0.1))[2] == pytest.approx(0.3)


def test_tumbling_is_tracked_by_gyroscope_under_acceleration() -> None:
    """Angles are given as functions of time; body rates follow from them by the textbook's kinematics."""
    attitude, dt, rng = MahonyFilter(gain_hz=0.2), 0.002, np.random.default_rng(3)
    for k in range(5000):
        t = k * dt
        roll, pitch, yaw = 0.6 * math.sin(t), 0.4 * math.sin(0.7 * t), wrap_rad(0.5 * t)
        rolls, pitches, yaws = 0.6 * math.cos(t), 0.28 * math.cos(0.7 * t), 0.5
        rates = (
            rolls - yaws * math.sin(pitch),
            pitches * math.cos(roll) + yaws * math.sin(roll) * math.cos(pitch),
            -pitches * math.sin(roll) + yaws * math.cos(roll) * math.cos(pitch),
        )
        force, field = measurement_of(quaternion_of(roll, pitch, yaw))
        shaken = [one + float(noise) for one, noise in zip(force, rng.normal(0.0, 2.0, 3), strict=True)] if k else force
        found = roll_pitch_yaw_rad(attitude.update(rates, shaken, field, t))
        off = [wrap_rad(a - b) for a, b in zip(found, (roll, pitch, yaw), strict=True)]
        assert off == pytest.approx([0.0] * 3, abs=0.03)


def test_yaw_is_zero_facing_east_and_quarter_turn_facing_north() -> None:
    """Yaw is 0 to the east and positive to the left."""
    assert roll_pitch_yaw_rad(attitude_at_rest(UP, (20.0, 0.0, -40.0)))[2] == pytest.approx(math.pi / 2)
    assert roll_pitch_yaw_rad(attitude_at_rest(UP, (0.0, 20.0, -40.0)))[2] == pytest.approx(0.0)


def test_steady_turn_is_tracked_within_0_01_deg() -> None:
    rate = 0.7
    off = final_errors_deg(
        lambda t: quaternion_of(0.0, 0.0, math.remainder(rate * t, math.tau)), (0.0, 0.0, rate), 20.0
    )
    assert max(map(abs, off)) < 0.01


def test_gyroscope_bias_is_estimated_within_0_1_deg() -> None:
    still = quaternion_of(0.2, -0.1, 1.0)
    bias = (0.5 * DEG, -0.5 * DEG, 0.5 * DEG)
    assert max(map(abs, final_errors_deg(lambda t: still, bias, 2.0))) > 0.4  # at first it leads astray
    assert max(map(abs, final_errors_deg(lambda t: still, bias, 200.0))) < 0.1


def test_acceleration_does_not_tilt_estimate() -> None:
    one = MahonyFilter()
    one.update((0.0, 0.0, 0.0), UP, NORTH_UT, 0.0)
    attitude = (1.0, 0.0, 0.0, 0.0)
    for i in range(1, 300):
        attitude = one.update((0.0, 0.0, 0.0), (6.0, 0.0, 9.80665), NORTH_UT, i / 100)
    assert roll_pitch_yaw_rad(attitude) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_magnetic_disturbance_changes_heading_only() -> None:
    one = MahonyFilter()
    one.update((0.0, 0.0, 0.0), UP, NORTH_UT, 0.0)
    attitude = (1.0, 0.0, 0.0, 0.0)
    for i in range(1, 8000):
        attitude = one.update((0.0, 0.0, 0.0), UP, (10.0, 20.0, -40.0), i / 100)
    roll, pitch, yaw = roll_pitch_yaw_rad(attitude)
    assert (roll, pitch) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert yaw == pytest.approx(math.atan2(10.0, 20.0), abs=0.02)
    for i in range(8000, 8200):  # a magnet: no field of the Earth's
        attitude = one.update((0.0, 0.0, 0.0), UP, (900.0, 0.0, 0.0), i / 100)
    assert roll_pitch_yaw_rad(attitude)[2] == pytest.approx(yaw, abs=0.05)


def test_filter_restarts_after_gap() -> None:
    one = MahonyFilter()
    one.update((0.0, 0.0, 0.0), UP, NORTH_UT, 0.0)
    turned = quaternion_of(0.0, 0.0, 2.0)
    assert roll_pitch_yaw_rad(one.update((0.0, 0.0, 0.0), *measurement_of(turned), 5.0))[2] == pytest.approx(2.0)
