"""A simulated satellite navigation receiver; `gps.py` reads a real one, and both give `GpsReading`.

true position --> velocity since the last fix --> errors --> latitude, longitude, speed, course

Its errors are slow: over minutes a position wanders by meters, and averaging for seconds removes nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import msgspec

from snr_sim.devices.readings import BiasDrift, SensorErrors, SimSensor
from snr_sim.prelude.geodesy import TangentPlane
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import GpsReading

if TYPE_CHECKING:
    import numpy as np

WANDERS_S = 60.0  # [O]
# As in logs of the kind of receiver that roveberrypy drove with; up: [O], about twice as much as level.
GPS_ERRORS: SensorErrors = SensorErrors(
    noise={"east_mps": 0.040, "north_mps": 0.106},
    drift={
        "east_m": BiasDrift(1.48, WANDERS_S),
        "north_m": BiasDrift(1.85, WANDERS_S),
        "up_m": BiasDrift(3.5, WANDERS_S),
    },
    period_s=0.1,
)


class GpsMeasurement(msgspec.Struct, frozen=True):
    """Position in the world's frame, which is the plane of the receiver's origin, and velocity over ground."""

    east_m: float
    north_m: float
    up_m: float
    east_mps: float
    north_mps: float
    stamp_s: float


@dataclass(frozen=True)
class GpsReceiver:
    """The part. [O]: our own choice.

    Args:
        latitude_deg, longitude_deg: of the world's origin: the Mars Desert Research Station in Utah.
        errors: by field of `GpsMeasurement`.
        satellites, hdop: as it reports them, under an open sky [O].
    """

    latitude_deg: float = 38.4064
    longitude_deg: float = -110.7919
    errors: SensorErrors = GPS_ERRORS
    satellites: int = 9
    hdop: float = 1.0

    def plane(self) -> TangentPlane:
        """Return the plane in which the world's x and y are."""
        return TangentPlane(self.latitude_deg, self.longitude_deg)

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Open it in a plant, at an output with the true `position_m`."""
        return SimSensor(plant, output, self.errors, rng, _measure(), self._reading())

    def _reading(self) -> Callable[[GpsMeasurement], GpsReading]:
        plane, satellites, hdop = self.plane(), self.satellites, self.hdop

        def reading(measured: GpsMeasurement) -> GpsReading:
            east_mps, north_mps = measured.east_mps, measured.north_mps
            return GpsReading(
                *plane.geodetic(measured.east_m, measured.north_m, measured.up_m),
                speed_mps=math.hypot(east_mps, north_mps),
                course_rad=math.atan2(north_mps, east_mps),
                satellites=satellites,
                hdop=hdop,
                stamp_s=measured.stamp_s,
            )

        return reading


def _measure() -> Callable[[Any], GpsMeasurement]:
    """Return what measures a position, and the mean velocity since the last time."""
    before: list[tuple[float, float, float]] = []  # east, north and when, of the last time

    def measure(pose: Any) -> GpsMeasurement:
        (east, north, up), now_s = pose.position_m, pose.stamp_s
        velocity = (0.0, 0.0)
        if before and now_s > before[0][2]:
            then_east, then_north, then_s = before[0]
            velocity = (east - then_east) / (now_s - then_s), (north - then_north) / (now_s - then_s)
        before[:] = [(east, north, now_s)]
        return GpsMeasurement(east, north, up, *velocity, now_s)

    return measure
