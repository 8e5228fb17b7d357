"""Attitudes as unit quaternions (w, x, y, z) from the body's frame to the world's, in plain numbers, for speed."""

from __future__ import annotations

import math
from typing import TypeAlias

Quaternion: TypeAlias = tuple[float, float, float, float]
Rotation: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]  # 3 x 3, row by row


def rotation_of(attitude: Quaternion) -> Rotation:
    """Return the matrix of a unit quaternion; its last row is the world's upward direction in the body frame."""
    w, x, y, z = attitude
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    return (
        1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy),
        2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx),
        2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy),
    )  # fmt: skip


def turned(first: Quaternion, then: Quaternion) -> Quaternion:
    """Return the attitude of a body that is turned, in its own frame, from an attitude."""
    (w, x, y, z), (a, b, c, d) = first, then
    return (
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    )


def in_body(rotation: Rotation, x: float, y: float, z: float) -> list[float]:
    """Return the body's components of a vector of the world."""
    a, b, c, d, e, f, g, h, i = rotation
    return [a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z]


def integrate_attitude(attitude: Quaternion, p: float, q: float, r: float, dt_s: float) -> Quaternion:
    """Return the attitude after turning at a rate (body frame) for a step.

    The turn is that of Cayley's form, angle 2 atan(rate dt / 2): with it `Hydrodynamics.advance` keeps the energy of
    weight and buoyancy to the last bit. It lags the true one by a fraction of (rate dt)^2 / 12.
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
