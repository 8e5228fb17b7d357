"""Attitude from rates, gravity and the field: a complementary filter on the rotation itself.

Rates give the change of attitude, and drift; gravity gives the slow reference for up, and the field that for north.
The persistent part of their correction is the gyroscopes' bias. With attitude q, bias b, rates w, and up from the
attitude and from the force (u, f, of length 1, body frame):

    q' = q (w - b + gain_hz e) / 2,    b' = -BIAS_GAIN_HZ2 e,    e = f x u + h u,

where h is how far the level part of the field, turned into the world, points east of north.

Source: R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear complementary filters on the special orthogonal group", IEEE
Transactions on Automatic Control 53 (2008), the passive filter; heading as an error about the vertical only, so that
iron nearby does not tilt it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

from snr_sim.prelude.angles import quaternion_of

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

GRAVITY_MPS2 = 9.80665
GAIN_HZ = 0.5
BIAS_GAIN_HZ2 = 0.02
MAX_BIAS_RADPS = 0.1
MAX_STEP_S = 0.5  # after a longer gap it starts again
_ACCELERATED = 0.15  # fraction of g: beyond, the force is not gravity alone
FIELD_UT = (15.0, 75.0)  # of the Earth, with some iron nearby


class MahonyFilter:
    """Estimates the attitude of a body in any orientation, also pointing straight up or upside down.

    Args:
        gain_hz: of corrections: the time constant is about its inverse; smaller for longer accelerations.
        declination_rad: of the local field: angle of magnetic north east of north.

    Attributes:
        attitude: quaternion [w, x, y, z] that turns vectors of the body into the world's (x east, y north, z up).
        bias_radps: estimated bias of the gyroscopes.
    """

    def __init__(self, gain_hz: float = GAIN_HZ, declination_rad: float = 0.0) -> None:
        self.gain_hz: float = gain_hz
        self.declination_rad: float = declination_rad
        self.attitude: Quaternion | None = None
        self.bias_radps: Vector = (0.0, 0.0, 0.0)
        self._at_s = 0.0
        self._before_radps: Vector = self.bias_radps

    def update(
        self, rate_radps: Sequence[float], force_mps2: Sequence[float], field_ut: Sequence[float], at_s: float
    ) -> Quaternion:
        """Process a measurement in the body's axes; return the attitude."""
        dt_s = at_s - self._at_s
        before, self._before_radps = self._before_radps, (rate_radps[0], rate_radps[1], rate_radps[2])
        self._at_s = at_s
        if self.attitude is None or not 0.0 <= dt_s <= MAX_STEP_S:
            self.attitude = attitude_at_rest(force_mps2, field_ut, self.declination_rad)
            return self.attitude
        # The mean of both ends: with the newest rate alone, at 50 Hz, a turn of 40 deg/s starts 0.4 deg ahead.
        (p, q, r), (bx, by, bz), half = self._before_radps, self.bias_radps, 0.5 * dt_s
        turn = (
            half * (p + before[0]) - bx * dt_s,
            half * (q + before[1]) - by * dt_s,
            half * (r + before[2]) - bz * dt_s,
        )
        turned = _rotate(self.attitude, turn)
        ex, ey, ez = self._error(turned, force_mps2, field_ut)
        gain, bias_gain = self.gain_hz * dt_s, BIAS_GAIN_HZ2 * dt_s
        self.attitude = _rotate(turned, (gain * ex, gain * ey, gain * ez))
        self.bias_radps = (
            _clamp_bias(bx - bias_gain * ex),
            _clamp_bias(by - bias_gain * ey),
            _clamp_bias(bz - bias_gain * ez),
        )
        return self.attitude

    def _error(self, attitude: Quaternion, force_mps2: Sequence[float], field_ut: Sequence[float]) -> Vector:
        """Return the small rotation [rad] in the body's axes that aligns up and north with the measurement."""
        ux, uy, uz = _up_in_body(attitude)
        x = y = z = 0.0
        force = _length(force_mps2)
        if abs(force - GRAVITY_MPS2) < _ACCELERATED * GRAVITY_MPS2:
            ax, ay, az = force_mps2
            x, y, z = (ay * uz - az * uy) / force, (az * ux - ax * uz) / force, (ax * uy - ay * ux) / force
        if FIELD_UT[0] < _length(field_ut) < FIELD_UT[1]:
            east, north, _ = into_world(attitude, field_ut)
            off = math.atan2(east, north) - self.declination_rad
            x, y, z = x + off * ux, y + off * uy, z + off * uz
        return x, y, z


def attitude_at_rest(
    force_mps2: Sequence[float], field_ut: Sequence[float], declination_rad: float = 0.0
) -> Quaternion:
    """Return the attitude at rest: up is where the force points, magnetic north where the field does."""
    ax, ay, az = force_mps2
    roll, pitch = math.atan2(ay, az), math.atan2(-ax, math.sqrt(ay * ay + az * az))
    east, north, _ = into_world(quaternion_of(roll, pitch, 0.0), field_ut)
    return quaternion_of(roll, pitch, math.atan2(east, north) - declination_rad)


def into_world(q: Quaternion, v: Sequence[float]) -> Vector:
    """Return a vector of the body in the world's axes."""
    w, x, y, z = q
    a, b, c = v
    # v + 2 w (u x v) + 2 u x (u x v)
    tx, ty, tz = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx


def _up_in_body(q: Quaternion) -> Vector:
    """Return the world's z axis in the body's axes."""
    w, x, y, z = q
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def _clamp_bias(bias_radps: float) -> float:
    return max(-MAX_BIAS_RADPS, min(MAX_BIAS_RADPS, bias_radps))


def _length(vector: Sequence[float]) -> float:
    x, y, z = vector
    return math.sqrt(x * x + y * y + z * z)  # rounded alike by every Python, and math.hypot is not


def _rotate(q: Quaternion, by_rad: Vector) -> Quaternion:
    """Return an attitude, turned about the body's axes."""
    angle = _length(by_rad)
    share = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    w1, x1, y1, z1 = q
    w2 = math.cos(0.5 * angle)
    x2, y2, z2 = share * by_rad[0], share * by_rad[1], share * by_rad[2]
    w = w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2
    x = w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2
    y = w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2
    z = w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    return w / norm, x / norm, y / norm, z / norm
