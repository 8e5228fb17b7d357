"""Outputs that plants of several robots have: true values, before sensor errors.

What a sensor makes of them is another record (`prelude/signals.py`). World frame: x east, y north, z up; body frame:
x forward, y left, z up.
"""

from __future__ import annotations

import msgspec

# Earth's field at about 50 degrees north, magnetic north along y: 20 uT level, 44 uT down (rounded).
FIELD_UT = (0.0, 20.0, -44.0)


class ImuOutput(msgspec.Struct, frozen=True):
    """Motion and field where the inertial unit is mounted, its axes along the body's; the attitude it finds itself."""

    rate_radps: list[float]  # [x, y, z] angular velocity, body frame
    specific_force_mps2: list[float]  # [x, y, z] acceleration less gravity, body frame: [0, 0, 9.81] at rest, upright
    field_ut: list[float]  # [x, y, z] magnetic field, body frame, with what the motors' currents add
    stamp_s: float


class PoseOutput(msgspec.Struct, frozen=True):
    """Position of the vehicle's origin and its attitude."""

    position_m: list[float]  # [x, y, z], world frame
    attitude: list[float]  # [w, x, y, z] unit quaternion that turns vectors of the body into the world's
    stamp_s: float


class PowerOutput(msgspec.Struct, frozen=True):
    """The battery's terminals."""

    voltage_v: float  # under load
    current_a: float  # out of the battery
    charge: float  # what is left of it, 0 empty to 1 full
    stamp_s: float
