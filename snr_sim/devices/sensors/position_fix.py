"""Where a vehicle is, as an observer above sees it. The vehicle does not know it by itself."""

from __future__ import annotations

from typing import Any

import msgspec

from snr_sim.devices.sensors.sensor_errors import SensorErrors
from snr_sim.prelude.angles import roll_pitch_yaw_rad

# A person sees to about a hand's breadth, some times a second, and needs a moment: our own choice.
POSITION_FIX_ERRORS = SensorErrors(
    noise={"position_m": 0.03, "yaw_rad": 0.03},
    delay_s=0.2,
    period_s=0.1,
)


class PositionFix(msgspec.Struct, frozen=True):
    """Where it is.

    Args:
        position_m: [x, y, z], world frame.
        yaw_rad: where it points.
        stamp_s: when.
    """

    position_m: list[float]
    yaw_rad: float
    stamp_s: float


def position_fix_of(plant: Any) -> PositionFix:
    """Return the true fix of a vehicle with `position_m`, `attitude` and `time_s`."""
    return PositionFix(list(plant.position_m), roll_pitch_yaw_rad(plant.attitude)[2], plant.time_s)
