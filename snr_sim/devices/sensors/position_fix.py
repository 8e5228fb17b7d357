"""Position of a vehicle, as an observer above sees it. The vehicle cannot measure it."""

from __future__ import annotations

from typing import Any

import msgspec

from snr_sim.devices.readings import SensorErrors
from snr_sim.prelude.angles import roll_pitch_yaw_rad

# A person sees to about the width of a hand, some times a second, with a delay: our own choice.
POSITION_FIX_ERRORS: SensorErrors = SensorErrors(
    noise={"position_m": 0.03, "yaw_rad": 0.03},
    delay_s=0.2,
    period_s=0.1,
)


class PositionFix(msgspec.Struct, frozen=True):
    """Position and heading.

    Args:
        position_m: [x, y, z], world frame.
        yaw_rad: heading.
        stamp_s: time of the fix.
    """

    position_m: list[float]
    yaw_rad: float
    stamp_s: float


def position_fix_of(plant: Any) -> PositionFix:
    """Return the true fix of a vehicle with `position_m`, `attitude` and `time_s`."""
    return PositionFix(list(plant.position_m), roll_pitch_yaw_rad(plant.attitude)[2], plant.time_s)
