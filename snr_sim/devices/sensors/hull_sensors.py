"""Sensors of hull and battery: a power module that measures voltage and current, and a leak probe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from snr_sim.devices.readings import SensorErrors, SimSensor, fields_of
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import LeakReading, PowerReading

if TYPE_CHECKING:
    import numpy as np

# A module for 60 V and 120 A with a 12-bit converter: steps follow from that; noise is about one (our own choice).
POWER_MODULE: SensorErrors = SensorErrors(
    noise={"voltage_v": 0.015, "current_a": 0.03},
    resolution={"voltage_v": 60.0 / 4096, "current_a": 120.0 / 4096},
    limits={"voltage_v": (0.0, 60.0), "current_a": (0.0, 120.0)},
)


@dataclass(frozen=True)
class PowerModule:
    """Measures at the battery. It shows more than 120 A as 120 A.

    Args:
        errors: by field of a `PowerReading`.
    """

    errors: SensorErrors = POWER_MODULE

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Open it in a plant, at an output with `voltage_v`, `current_a` and `stamp_s`."""
        return SimSensor(plant, output, self.errors, rng, fields_of(PowerReading))


@dataclass(frozen=True)
class LeakProbe:
    """A sponge between two contacts, low in the hull. Once wet it stays wet.

    Args:
        trip_volume_l: litres in the hull at which it gets wet: our own choice.
    """

    trip_volume_l: float = 0.02

    def __post_init__(self) -> None:
        if not self.trip_volume_l > 0.0:
            raise ParameterError(
                f"Leak probe trip_volume_l must be positive, not {self.trip_volume_l!r}.",
                fix="use a volume in litres, such as 0.02.",
            )

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Open it in a plant, at an output with `water_l` and `stamp_s`."""
        was_wet = False

        def leak_reading(hull: Any) -> LeakReading:
            nonlocal was_wet
            was_wet = was_wet or hull.water_l >= self.trip_volume_l
            return LeakReading(was_wet, hull.stamp_s)

        return SimSensor(plant, output, SensorErrors(), rng, leak_reading)
