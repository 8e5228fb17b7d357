"""An inertial unit that fuses its own attitude, with the numbers of a BNO055.

[D] data sheet; [M] from memory of the field, not read again; [O] our own choice. The fused attitude is the true one
with an error that wanders: how the part's own filter is led astray by accelerations is not modelled. The magnetometer
tells as often as the rest, where the real one is five times slower.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from snr_sim.devices.sensor_errors import SensorErrors, Wander
from snr_sim.devices.simulated import SimSensor
from snr_sim.prelude.angles import roll_pitch_yaw_rad, wrap_rad
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import ImuReading

if TYPE_CHECKING:
    import numpy as np

_DEG = math.radians(1.0)

BNO055 = SensorErrors(
    noise={
        "rate_radps": 0.12 * _DEG,  # 0.014 deg/s per root Hz, as of its gyroscope sold as BMI055, in 47 Hz
        "specific_force_mps2": 0.015,  # 150 ug per root Hz, as of the BMI055, in 62.5 Hz
        "field_ut": 0.5,  # [O]
        "roll_rad": 0.05 * _DEG,  # [O]
        "pitch_rad": 0.05 * _DEG,  # [O]
        "yaw_rad": 0.05 * _DEG,  # [O]
    },
    resolution={
        "rate_radps": _DEG / 16.0,  # [D]
        "specific_force_mps2": 0.01,  # [D]
        "field_ut": 0.3,  # [D]
        "roll_rad": _DEG / 16.0,  # [D]
        "pitch_rad": _DEG / 16.0,  # [D]
        "yaw_rad": _DEG / 16.0,  # [D]
    },
    wander={
        "rate_radps": Wander(0.05 * _DEG, 300.0),  # what is left of the bias that its fusion takes out [O]
        "specific_force_mps2": Wander(0.08),  # [M]: 80 mg of the data sheet are before calibration; a tenth is left [O]
        "field_ut": Wander(1.0),  # what is left of hard iron after calibration [O]
        "roll_rad": Wander(0.3 * _DEG, 60.0),  # [O]
        "pitch_rad": Wander(0.3 * _DEG, 60.0),  # [O]
        "yaw_rad": Wander(1.25 * _DEG, 60.0),  # within 2.5 deg [M], taken for two standard deviations
    },
    limits={
        "rate_radps": (-2000.0 * _DEG, 2000.0 * _DEG),  # [D]
        "specific_force_mps2": (-39.2, 39.2),  # 4 g, as its fusion sets it [D]
    },
    delay_s=0.01,  # one period of its fusion [O]
    period_s=0.01,  # its fusion tells 100 times a second [D]
)


@dataclass(frozen=True)
class InertialUnit:
    """The part.

    Args:
        errors: how it measures, by field of an `ImuReading`.
    """

    errors: SensorErrors = BNO055

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Opens it in a plant, at an output with the true rate, specific force, field and attitude quaternion."""
        return SimSensor(plant, output, self.errors, rng, _felt, _wrapped)


def _felt(motion: Any) -> ImuReading:
    return ImuReading(
        motion.rate_radps,
        motion.specific_force_mps2,
        motion.field_ut,
        *roll_pitch_yaw_rad(motion.attitude),
        motion.stamp_s,
    )


def _wrapped(reading: ImuReading) -> ImuReading:
    """Errors may carry an angle over half a turn."""
    roll, yaw = reading.roll_rad, reading.yaw_rad
    if -math.pi < roll <= math.pi and -math.pi < yaw <= math.pi:
        return reading
    return ImuReading(
        reading.rate_radps,
        reading.specific_force_mps2,
        reading.field_ut,
        wrap_rad(roll),
        reading.pitch_rad,
        wrap_rad(yaw),
        reading.stamp_s,
    )
