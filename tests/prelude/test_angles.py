import math
from collections.abc import Sequence

import numpy as np
import pytest

from snr_sim.prelude.angles import quaternion_of, roll_pitch_yaw_rad, wrap_rad


@pytest.mark.parametrize("turns", [-3, -1, 0, 1, 7])
@pytest.mark.parametrize("angle", [-3.0, -1e-9, 0.0, 0.5, 3.1, math.pi])
def test_wrapping_takes_off_whole_turns_and_nothing_else(angle: float, turns: int) -> None:
    assert wrap_rad(angle + 2.0 * math.pi * turns) == pytest.approx(angle, abs=1e-12)


def test_angle_within_half_a_turn_is_returned_unchanged() -> None:
    assert wrap_rad(0.1) == 0.1
    assert -math.pi < wrap_rad(math.nextafter(math.pi, 4.0)) <= math.pi


def matrix(attitude: Sequence[float]) -> np.ndarray:
    """The rotation that a quaternion is, from its textbook form q v q*."""
    w, v = attitude[0], np.array(attitude[1:])
    across = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * across + 2.0 * across @ across


def turn(axis: int, angle: float) -> np.ndarray:
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    rotation = np.eye(3)
    rotation[i, i] = rotation[j, j] = math.cos(angle)
    rotation[i, j], rotation[j, i] = -math.sin(angle), math.sin(angle)
    return rotation


def test_the_quaternion_turns_as_yaw_then_pitch_then_roll_do() -> None:
    for roll, pitch, yaw in np.random.default_rng(1).uniform(-1.5, 1.5, (50, 3)):
        attitude = quaternion_of(roll, pitch, yaw)
        assert matrix(attitude) == pytest.approx(turn(2, yaw) @ turn(1, pitch) @ turn(0, roll), abs=1e-12)
        assert roll_pitch_yaw_rad(attitude) == pytest.approx((roll, pitch, yaw), abs=1e-9)


def test_signs_are_those_of_x_forward_y_left_z_up() -> None:
    left, nose = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    assert (matrix(quaternion_of(0.3, 0.0, 0.0)) @ left)[2] > 0.0, "rolled, the left side rises"
    assert (matrix(quaternion_of(0.0, 0.3, 0.0)) @ nose)[2] < 0.0, "pitched, the nose goes down"
    assert (matrix(quaternion_of(0.0, 0.0, 0.3)) @ nose)[1] > 0.0, "yawed, the nose goes left"


def test_straight_up_rounding_does_not_raise() -> None:
    half = math.sqrt(0.5)
    assert roll_pitch_yaw_rad([half, 0.0, half * (1.0 + 1e-15), 0.0])[1] == pytest.approx(0.5 * math.pi)
