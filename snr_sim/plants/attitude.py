"""Attitudes as unit quaternions (w, x, y, z) from the body's frame to the world's, in plain numbers, for speed."""

from __future__ import annotations

import math
from typing import TypeAlias

Quaternion: TypeAlias = tuple[float, float, float, float]
Rotation: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]  # 3 x 3, row by row


def rotation_of(attitude: Quaternion) -> Rotation:
    """Returns the matrix of a unit quaternion; its last row is the world's upward direction in the body frame."""
    w, x, y, z = attitude
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    return (
        1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy),
        2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx),
        2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy),
    )  # fmt: skip


def turned(attitude: Quaternion, p: float, q: float, r: float, dt_s: float) -> Quaternion:
    """Returns the attitude after turning at a rate (body frame) for a step.

    The turn is that of Cayley's form, angle 2 atan(rate dt / 2): with it `Hydrodynamics.advance` keeps the energy of
    weight and buoyancy to the last bit. It lags the true one by a share of (rate dt)^2 / 12.
    """
    w, x, y, z = attitude
    half = 0.5 * dt_s
    a, b, c = half * p, half * q, half * r
    nw, nx, ny, nz = (
        w - x * a - y * b - z * c,
        x + w * a + y * c - z * b,
        y + w * b + z * a - x * c,
        z + w * c + x * b - y * a,
    )
    scale = 1.0 / math.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    return nw * scale, nx * scale, ny * scale, nz * scale


def from_angles(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Returns the attitude that yaw, then pitch, then roll lead to, each about the axis as it then stands.

    Positive: roll to the right, nose down, and to the left; as right hands turn about x, y and z.

    >>> from_angles(0.0, 0.0, 0.0)
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


def to_angles(attitude: Quaternion) -> tuple[float, float, float]:
    """Returns roll, pitch and yaw of an attitude, as in `from_angles`.

    >>> [round(angle, 9) for angle in to_angles(from_angles(0.1, -0.2, 3.0))]
    [0.1, -0.2, 3.0]
    """
    r11, _, _, r21, _, _, r31, r32, r33 = rotation_of(attitude)
    return math.atan2(r32, r33), math.asin(min(1.0, max(-1.0, -r31))), math.atan2(r21, r11)
