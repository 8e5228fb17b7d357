"""The Ping echo sounder: distance to the floor, and its confidence.

It sends a cone of sound and takes the strongest echo. On a level floor that is the one from straight below, as long as
that is in the cone; at larger tilt it is the nearest edge of the cone's footprint, and weaker. So a vehicle with a
small roll reads the same height, and one with a large roll reads too much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from snr_sim.devices.readings import SensorErrors, SimSensor
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import EchoReading

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class EchoSounder:
    """The part. Range, cone and resolution are those of the Ping1D; the rest is our own choice.

    Args:
        min_range_m: minimum distance: below it receives its own ping.
        max_range_m: maximum distance.
        cone_rad: full angle of the cone.
        max_tilt_rad: tilt at which the confidence has fallen to 0.
        noise_m: standard deviation of a distance.
        period_s: between two pings.

    Raises:
        ParameterError: a number is out of range.
    """

    min_range_m: float = 0.3
    max_range_m: float = 100.0
    cone_rad: float = math.radians(25.0)
    max_tilt_rad: float = math.radians(60.0)
    noise_m: float = 0.01
    period_s: float = 0.1

    def __post_init__(self) -> None:
        if not 0.0 <= self.min_range_m < self.max_range_m:
            raise ParameterError(
                f"Echo sounder min_range_m={self.min_range_m!r} does not fit max_range_m={self.max_range_m!r}.",
                fix="min_range_m must be 0 or more and below max_range_m, for example 0.3 and 100.",
            )
        if not 0.0 < 0.5 * self.cone_rad < self.max_tilt_rad < 0.5 * math.pi:
            raise ParameterError(
                f"Echo sounder cone_rad={self.cone_rad!r} does not fit max_tilt_rad={self.max_tilt_rad!r}.",
                fix="half of cone_rad must be below max_tilt_rad, and max_tilt_rad below pi/2.",
            )

    def range_and_confidence(self, altitude_m: float, tilt_rad: float) -> tuple[float, float]:
        """Return distance [m] and confidence at a height over a level floor and a tilt from straight down."""
        beyond = tilt_rad - 0.5 * self.cone_rad
        if beyond <= 0.0:
            distance, confidence = altitude_m, 1.0
        elif tilt_rad < self.max_tilt_rad:
            distance = altitude_m / math.cos(beyond)
            confidence = 1.0 - beyond / (self.max_tilt_rad - 0.5 * self.cone_rad)
        else:
            return 0.0, 0.0
        return (distance, confidence) if self.min_range_m <= distance <= self.max_range_m else (0.0, 0.0)

    @property
    def errors(self) -> SensorErrors:
        """Errors of the reading: whole millimetres, as the part reports them."""
        return SensorErrors(
            noise={"distance_m": self.noise_m},
            resolution={"distance_m": 0.001, "confidence": 0.01},
            limits={"distance_m": (0.0, self.max_range_m)},
            period_s=self.period_s,
        )

    def echo(self, below: Any) -> EchoReading:
        """Return the echo for a plant's output with `altitude_m`, `tilt_rad` and `stamp_s`."""
        return EchoReading(*self.range_and_confidence(below.altitude_m, below.tilt_rad), below.stamp_s)

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Open the sounder in a plant."""
        return SimSensor(plant, output, self.errors, rng, self.echo, _zero_without_echo)


def _zero_without_echo(reading: EchoReading) -> EchoReading:
    return reading if reading.confidence > 0.0 else EchoReading(0.0, 0.0, reading.stamp_s)
