"""The MS5837-30BA pressure sensor (Bar30): what it resolves, how long it takes, and depth from its pressure.

Facts from its data sheet; the way from pressure to depth, and the densities, as in its maker's own library. A sensor is
off by up to a fifth of a bar when it is new, which is two metres of water: so whoever dives sets it to zero first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import msgspec

from snr_sim.devices.sensor_errors import SensorErrors, Wander
from snr_sim.devices.simulated import SimSensor
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import DepthReading

if TYPE_CHECKING:
    import numpy as np

STANDARD_GRAVITY_MPS2 = 9.80665
AIR_PA = 101_300.0  # the library's idea of the air at sea level
FRESH_KGM3, SALT_KGM3 = 997.0, 1029.0
OVERSAMPLING = (256, 512, 1024, 2048, 4096, 8192)
CONVERSION_S_PER_SAMPLE = 2.2e-6  # one conversion, at most; a measurement is two: pressure, then temperature
RESOLUTION_PA = 20.0  # at the highest oversampling: 2 mm of water
RESOLUTION_C = 0.01
LIMITS_PA = (0.0, 3_000_000.0)
# Not on the data sheet: noise as users of the sensor report it, 0.2 to 0.5 mbar; half of the offset's usual range.
NOISE_PA = 30.0
OFFSET_PA = 5_000.0


class Water(Protocol):
    """What a plant's output must tell of the water at the sensor."""

    @property
    def pressure_pa(self) -> float:
        """Absolute."""
        ...

    @property
    def temperature_c(self) -> float:
        """Of the water."""
        ...

    @property
    def stamp_s(self) -> float:
        """When."""
        ...


class Pressure(msgspec.Struct, frozen=True):
    """What the sensor feels."""

    pressure_pa: float
    temperature_c: float
    stamp_s: float


def depth_m(pressure_pa: float, surface_pa: float = AIR_PA, density_kgm3: float = FRESH_KGM3) -> float:
    """Returns the depth at a pressure, positive down.

    >>> round(depth_m(399_980.0), 3), round(depth_m(399_980.0, density_kgm3=SALT_KGM3), 3)
    (30.549, 29.599)
    """
    return (pressure_pa - surface_pa) / (density_kgm3 * STANDARD_GRAVITY_MPS2)


@dataclass(frozen=True)
class Ms5837:
    """How the sensor is used.

    Args:
        oversampling: samples that make a measurement; more are slower. Noise and resolution here are those of 8192.
        is_zeroed: somebody set it to zero at the surface, before the dive. If not, it has the offset it was made with.
        surface_pa: what it takes for the pressure at the surface.
        density_kgm3: what it takes for the water's density.
        noise_pa: standard deviation of a measurement.

    Raises:
        ParameterError: the sensor has no such oversampling.
    """

    oversampling: int = 8192
    is_zeroed: bool = True
    surface_pa: float = 101_325.0
    density_kgm3: float = FRESH_KGM3
    noise_pa: float = NOISE_PA

    def __post_init__(self) -> None:
        if self.oversampling not in OVERSAMPLING:
            raise ParameterError(
                f"An MS5837 with oversampling {self.oversampling!r}.",
                fix=f"one of {', '.join(map(str, OVERSAMPLING))}.",
            )

    @property
    def period_s(self) -> float:
        """How long one measurement of pressure and temperature takes."""
        return 2.0 * CONVERSION_S_PER_SAMPLE * self.oversampling

    @property
    def errors(self) -> SensorErrors:
        """How it measures. What is told was measured while the conversions ran, so it is a conversion old."""
        return SensorErrors(
            noise={"pressure_pa": self.noise_pa},
            resolution={"pressure_pa": RESOLUTION_PA, "temperature_c": RESOLUTION_C},
            delay_s=0.5 * self.period_s,
            wander={} if self.is_zeroed else {"pressure_pa": Wander(OFFSET_PA, math.inf)},
            limits={"pressure_pa": LIMITS_PA},
            period_s=self.period_s,
        )

    def tells(self) -> Callable[[Pressure], DepthReading]:
        """Returns what makes a reading of a measurement."""
        surface_pa, density_kgm3 = self.surface_pa, self.density_kgm3

        def reading(felt: Pressure) -> DepthReading:
            depth = depth_m(felt.pressure_pa, surface_pa, density_kgm3)
            return DepthReading(depth, felt.pressure_pa, felt.temperature_c, felt.stamp_s)

        return reading

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Opens the sensor in a plant, at an output that tells of the water (`Water`)."""
        return SimSensor(plant, output, self.errors, rng, _felt, self.tells())


def _felt(water: Any) -> Pressure:
    return Pressure(water.pressure_pa, water.temperature_c, water.stamp_s)
