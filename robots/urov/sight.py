"""Where the vehicle is, as somebody sees it who looks into the water from above. The vehicle does not know it."""

from __future__ import annotations

from typing import Any

import msgspec

from snr_sim.devices.sensors.sensor_errors import SensorErrors
from snr_sim.prelude.angles import roll_pitch_yaw_rad

# A person sees to about a hand's breadth, some times a second, and needs a moment: our own choice.
EYES = SensorErrors(
    noise={"position_m": 0.03, "yaw_rad": 0.03},
    delay_s=0.2,
    period_s=0.1,
)


class Place(msgspec.Struct, frozen=True):
    """Where it is.

    Args:
        position_m: [x, y, z], world frame.
        yaw_rad: where it points.
        stamp_s: when.
    """

    position_m: list[float]
    yaw_rad: float
    stamp_s: float


def place_of(plant: Any) -> Place:
    """Returns the true place of a vehicle."""
    return Place(list(plant.position_m), roll_pitch_yaw_rad(plant.attitude)[2], plant.time_s)
