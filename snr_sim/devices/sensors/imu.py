"""An inertial unit that computes its own attitude, with the numbers of a BNO055.

    true rate, force and field --> errors --> rate_radps, specific_force_mps2, field_ut
                                                `--> MahonyFilter --> roll_rad, pitch_rad, yaw_rad

The attitude depends only on the measurements with their errors: a long acceleration tilts it, and iron or a thruster's
current nearby turns its heading by the angle that it turns the level field. The filter is ours, as the part's own is
not published; it runs with each reading, while the part's runs 100 times a second.

[D] data sheet; [O] our own choice or estimate. The magnetometer reports at the rate of the others; the real one is
five times slower.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec

from snr_sim.devices.readings import BiasDrift, SensorErrors, SimSensor, fields_of
from snr_sim.prelude.angles import roll_pitch_yaw_rad, wrap_rad
from snr_sim.prelude.attitude_filter import MahonyFilter
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import ImuReading

if TYPE_CHECKING:
    import numpy as np

_DEG = math.radians(1.0)

BNO055: SensorErrors = SensorErrors(
    noise={
        "rate_radps": 0.12 * _DEG,  # 0.014 deg/s per root Hz, as of its gyroscope sold as BMI055, in 47 Hz
        "specific_force_mps2": 0.015,  # 150 ug per root Hz, as of the BMI055, in 62.5 Hz
        "field_ut": 0.5,  # [O]
    },
    resolution={
        "rate_radps": _DEG / 16.0,  # [D]
        "specific_force_mps2": 0.01,  # [D]
        "field_ut": 0.3,  # [D]
    },
    drift={
        "rate_radps": BiasDrift(0.05 * _DEG, 300.0),  # rest of the bias that its fusion removes [O]
        # Error after calibration [O]: at rest, up is .05 / 9.81 = 0.3 degrees off, and the heading is known to
        # 2.5 degrees [O], taken for two standard deviations. In the field of 50 degrees north, 20 uT level and 44 down,
        # one of them is hypot(.37 / 20, .05 / 9.81 * 44 / 20) = .0216 rad.
        "specific_force_mps2": BiasDrift(0.05),
        "field_ut": BiasDrift(0.37),
    },
    limits={
        "rate_radps": (-2000.0 * _DEG, 2000.0 * _DEG),  # [D]
        "specific_force_mps2": (-39.2, 39.2),  # 4 g, as set by its fusion [D]
    },
    delay_s=0.01,  # one period of its fusion [O]
    period_s=0.01,  # its fusion reports 100 times a second [D]
)


class InertialMeasurement(msgspec.Struct, frozen=True):
    """Measurements of the unit's three sensors: fields of an `ImuReading`."""

    rate_radps: list[float]
    specific_force_mps2: list[float]
    field_ut: list[float]
    stamp_s: float


@dataclass(frozen=True)
class InertialUnit:
    """The part.

    Args:
        errors: of its sensors, by field of `InertialMeasurement`. Those of its angles follow from them.
        angle_step_rad: step that angles are rounded to; 0: none.
    """

    errors: SensorErrors = BNO055
    angle_step_rad: float = _DEG / 16.0  # [D]

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Open it in a plant, at an output with the true `rate_radps`, `specific_force_mps2` and `field_ut`."""
        return SimSensor(plant, output, self.errors, rng, fields_of(InertialMeasurement), self._fused())

    def _fused(self) -> Callable[[InertialMeasurement], ImuReading]:
        attitude, step = MahonyFilter(), self.angle_step_rad

        def reading(measured: InertialMeasurement) -> ImuReading:
            rate, force, field = measured.rate_radps, measured.specific_force_mps2, measured.field_ut
            angles = roll_pitch_yaw_rad(attitude.update(rate, force, field, measured.stamp_s))
            if step:
                roll, pitch, yaw = (round(angle / step) * step for angle in angles)
                angles = wrap_rad(roll), pitch, wrap_rad(yaw)
            return ImuReading(rate, force, field, *angles, measured.stamp_s)

        return reading
