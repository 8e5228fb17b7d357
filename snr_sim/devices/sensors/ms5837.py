"""The MS5837-30BA pressure sensor (Bar30): resolution, conversion time, and depth from its pressure.

More oversampling takes longer and is less noisy. The offset of a new sensor is up to a fifth of a bar, which is two
metres of water: so zero it before a dive.

Source: TE Connectivity, MS5837-30BA data sheet (10/2015; C2 of 12/2019): conversion times, and "resolution RMS" of
pressure by oversampling, which is the standard deviation here. That of 512 and 1024 is from memory, the other four were
read again. Temperature's, 2 to 9 thousandths of a degree, is below the step of its reading and left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec

from snr_sim.devices.readings import BiasDrift, SensorErrors, SimSensor, fields_of
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import DepthReading
from snr_sim.prelude.water import AIR_PA, FRESH_KGM3, GRAVITY_MPS2

if TYPE_CHECKING:
    import numpy as np

NOISE_PA: dict[int, float] = {256: 157.0, 512: 84.0, 1024: 54.0, 2048: 38.0, 4096: 28.0, 8192: 20.0}  # by oversampling
OVERSAMPLING: tuple[int, ...] = tuple(NOISE_PA)
CONVERSION_S_PER_SAMPLE = 2.2e-6  # one conversion, at most; a measurement has two: pressure, then temperature
RESOLUTION_PA = 10.0  # a tenth of a millibar, the last digit of the data sheet's P: 1 mm of water
RESOLUTION_C = 0.01
LIMITS_PA: tuple[float, float] = (0.0, 3_000_000.0)
OFFSET_PA = 5_000.0  # half of the usual range: our estimate


class Pressure(msgspec.Struct, frozen=True):
    """The quantities that the sensor measures."""

    pressure_pa: float
    temperature_c: float
    stamp_s: float


def depth_m(
    pressure_pa: float,
    surface_pa: float = AIR_PA,
    density_kgm3: float = FRESH_KGM3,
    gravity_mps2: float = GRAVITY_MPS2,
) -> float:
    """Return the depth at a pressure, positive down, in incompressible water.

    >>> round(depth_m(399_980.0, 101_300.0, 997.0, 9.80665), 3)  # with the numbers of its maker's own library
    30.549
    """
    return (pressure_pa - surface_pa) / (density_kgm3 * gravity_mps2)


@dataclass(frozen=True)
class Ms5837:
    """Settings of the sensor.

    It reads the true depth if it has the parameters of the water that it is in. Surface, density and gravity are those
    of a pool by default: for a `Pool(density_kgm3=1026.0)` use an `Ms5837(density_kgm3=1026.0)`.

    Args:
        oversampling: samples per measurement; more are slower and less noisy.
        is_zeroed: it was zeroed at the surface before the dive. If not, it has its offset from production.
        surface_pa: pressure at the surface that it assumes.
        density_kgm3: density of the water that it assumes.
        gravity_mps2: gravity that it assumes.
        noise_pa: standard deviation of a measurement; None: the data sheet's for the oversampling.

    Raises:
        ParameterError: the sensor does not have this oversampling, or a number of the water is out of range.
    """

    oversampling: int = 8192
    is_zeroed: bool = True
    surface_pa: float = AIR_PA
    density_kgm3: float = FRESH_KGM3
    gravity_mps2: float = GRAVITY_MPS2
    noise_pa: float | None = None

    def __post_init__(self) -> None:
        if self.oversampling not in OVERSAMPLING:
            raise ParameterError(
                f"MS5837 oversampling is {self.oversampling!r}.",
                fix=f"use one of {', '.join(map(str, OVERSAMPLING))}.",
            )
        for name in ("density_kgm3", "gravity_mps2"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ParameterError(
                    f"MS5837 {name} must be positive and finite, not {getattr(self, name)!r}.",
                    fix=f"use that of its pool; usual are {FRESH_KGM3:g} kg/m3 and {GRAVITY_MPS2:g} m/s2.",
                )

    @property
    def period_s(self) -> float:
        """Time of one measurement of pressure and temperature."""
        return 2.0 * CONVERSION_S_PER_SAMPLE * self.oversampling

    @property
    def errors(self) -> SensorErrors:
        """Errors of the reading. It was measured while the conversions ran, so it is a conversion old."""
        return SensorErrors(
            noise={"pressure_pa": NOISE_PA[self.oversampling] if self.noise_pa is None else self.noise_pa},
            resolution={"pressure_pa": RESOLUTION_PA, "temperature_c": RESOLUTION_C},
            delay_s=0.5 * self.period_s,
            drift={} if self.is_zeroed else {"pressure_pa": BiasDrift(OFFSET_PA, math.inf)},
            limits={"pressure_pa": LIMITS_PA},
            period_s=self.period_s,
        )

    def reading(self, measured: Pressure) -> DepthReading:
        """Return the reading of a measurement."""
        depth = depth_m(measured.pressure_pa, self.surface_pa, self.density_kgm3, self.gravity_mps2)
        return DepthReading(depth, measured.pressure_pa, measured.temperature_c, measured.stamp_s)

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Open the sensor in a plant, at an output with `pressure_pa`, `temperature_c` and `stamp_s` of the water."""
        return SimSensor(plant, output, self.errors, rng, fields_of(Pressure), self.reading)
