"""Angles: the shorter direction of a turn, and attitude as roll, pitch and yaw.

Axes as everywhere here: body x forward, y left, z up. So roll turns about x (positive: the left side rises), pitch
about y (positive: the nose goes down) and yaw about z (positive: the nose goes left), yaw first and roll last.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

_TURN_RAD = 2.0 * math.pi


def wrap_rad(angle_rad: float) -> float:
    """Return the same direction as an angle from -pi (left out) to pi.

    >>> round(wrap_rad(math.radians(350.0)), 6) == round(math.radians(-10.0), 6)
    True
    >>> wrap_rad(-math.pi) == wrap_rad(math.pi) == math.pi
    True
    """
    wrapped = math.remainder(angle_rad, _TURN_RAD)
    return math.pi if wrapped <= -math.pi else wrapped


def roll_pitch_yaw_rad(attitude: Sequence[float]) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a unit quaternion [w, x, y, z] that turns vectors of the body into the world's.

    >>> [round(angle, 6) for angle in roll_pitch_yaw_rad(quaternion_of(0.1, -0.2, 3.0))]
    [0.1, -0.2, 3.0]
    """
    w, x, y, z = attitude
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(min(1.0, max(-1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def quaternion_of(roll_rad: float, pitch_rad: float, yaw_rad: float) -> tuple[float, float, float, float]:
    """Return the unit quaternion (w, x, y, z) of an attitude.

    >>> quaternion_of(0.0, 0.0, 0.0)
    (1.0, 0.0, 0.0, 0.0)
    """
    cr, sr = math.cos(0.5 * roll_rad), math.sin(0.5 * roll_rad)
    cp, sp = math.cos(0.5 * pitch_rad), math.sin(0.5 * pitch_rad)
    cy, sy = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
