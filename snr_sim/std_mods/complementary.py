"""Complementary filters: a gyroscope for the quick, something slower and steadier for the long run.

A gyroscope's rate, summed up, is smooth and quick, and drifts away. Gravity or a magnetic field say where down and
north are, without drift, but shaken by every acceleration and disturbance. The filter follows the sum of rates, and
lets itself be pulled to the steady measurement with a time constant: what is faster than it comes from the gyroscope,
what is slower from the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from snr_sim.prelude.angles import wrap_rad
from snr_sim.prelude.errors import ParameterError


class ComplementaryFilter:
    """One quantity of which both the rate and, slowly or noisily, the value are measured.

    Args:
        time_constant_s: of the pull to the measured value. A bias b of the rate leaves an error of b times this.
        is_angle: values are angles [rad], and the pull goes the shorter way round.

    Raises:
        ParameterError: the time constant is not above 0.

    >>> heading = ComplementaryFilter(time_constant_s=2.0)
    >>> heading.update(rate=0.0, measured=1.0, dt_s=0.1)  # the first value is taken as it is
    1.0
    >>> round(heading.update(rate=0.5, measured=1.05, dt_s=0.1), 6)
    1.05
    """

    def __init__(self, time_constant_s: float, is_angle: bool = False) -> None:
        if not (math.isfinite(time_constant_s) and time_constant_s > 0.0):
            raise ParameterError(
                f"A complementary filter with time_constant_s={time_constant_s!r}.", fix="seconds above 0, such as 2.0."
            )
        self.time_constant_s = time_constant_s
        self.is_angle = is_angle
        self.estimate: float | None = None

    def reset(self) -> None:
        """Forgets; the next measured value is taken as it is."""
        self.estimate = None

    def update(self, rate: float, measured: float, dt_s: float) -> float:
        """Returns the estimate for now.

        Args:
            rate: of the quantity, since the update before.
            measured: the quantity, as the slow or noisy sensor has it now.
            dt_s: since the update before.

        Raises:
            ParameterError: a value is not finite, or time goes back.
        """
        if not (dt_s >= 0.0 and math.isfinite(rate) and math.isfinite(measured)):
            raise ParameterError(
                f"A complementary filter got rate={rate!r}, measured={measured!r}, dt_s={dt_s!r}.",
                fix="finite numbers and a dt_s that is not negative.",
            )
        if self.estimate is None:
            self.estimate = measured
            return measured
        moved = self.estimate + rate * dt_s
        away = measured - moved
        if self.is_angle:
            away = wrap_rad(away)
        # The share that a first-order lag covers in this time, exactly: no step is too long for it.
        moved -= away * math.expm1(-dt_s / self.time_constant_s)
        self.estimate = wrap_rad(moved) if self.is_angle else moved
        return self.estimate


class AttitudeFilter:
    """Roll, pitch and yaw from gyroscope, accelerometer and magnetometer.

    Good for a vehicle that does not point straight up or down: there roll and yaw are the same.

    Args:
        tilt_s: time constant of the pull to gravity; longer than any acceleration of the vehicle lasts.
        heading_s: time constant of the pull to the magnetic field.
        declination_rad: of the field at the place: how far magnetic north lies to the east of north.
    """

    def __init__(self, tilt_s: float = 1.0, heading_s: float = 2.0, declination_rad: float = 0.0) -> None:
        self.roll = ComplementaryFilter(tilt_s, is_angle=True)
        self.pitch = ComplementaryFilter(tilt_s, is_angle=True)
        self.yaw = ComplementaryFilter(heading_s, is_angle=True)
        self.declination_rad = declination_rad

    def update(
        self, rate_radps: Sequence[float], specific_force_mps2: Sequence[float], field_ut: Sequence[float], dt_s: float
    ) -> tuple[float, float, float]:
        """Returns roll, pitch and yaw [rad] for now; yaw is 0 to the east (x), pi / 2 to the north (y).

        Args:
            rate_radps: [x, y, z] of the gyroscope.
            specific_force_mps2: [x, y, z] of the accelerometer: [0, 0, 9.81] at rest and upright.
            field_ut: [x, y, z] of the magnetometer.
            dt_s: since the update before.
        """
        roll, pitch = tilt_rad(specific_force_mps2)
        before_roll, before_pitch = self.roll.estimate or 0.0, self.pitch.estimate or 0.0
        p, q, r = rate_radps
        across = q * math.sin(before_roll) + r * math.cos(before_roll)
        upright = math.copysign(max(0.05, abs(math.cos(before_pitch))), math.cos(before_pitch))
        roll = self.roll.update(p + across * math.sin(before_pitch) / upright, roll, dt_s)
        pitch = self.pitch.update(q * math.cos(before_roll) - r * math.sin(before_roll), pitch, dt_s)
        heading = heading_rad(field_ut, roll, pitch) - self.declination_rad
        return roll, pitch, self.yaw.update(across / upright, wrap_rad(heading), dt_s)


def tilt_rad(specific_force_mps2: Sequence[float]) -> tuple[float, float]:
    """Returns roll and pitch of something that stands still, from what its accelerometer feels."""
    x, y, z = specific_force_mps2
    return math.atan2(y, z), math.atan2(-x, math.hypot(y, z))


def heading_rad(field_ut: Sequence[float], roll_rad: float, pitch_rad: float) -> float:
    """Returns the yaw at which the level part of a field points to magnetic north (y), given the tilt."""
    x, y, z = field_ut
    level_y = y * math.cos(roll_rad) - z * math.sin(roll_rad)
    down = y * math.sin(roll_rad) + z * math.cos(roll_rad)
    level_x = x * math.cos(pitch_rad) + down * math.sin(pitch_rad)
    # Seen from the vehicle the field stands at this angle from ahead; in the world it stands at 90 degrees.
    return wrap_rad(0.5 * math.pi - math.atan2(level_y, level_x))
