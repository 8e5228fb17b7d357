"""A motor with a gear at a wheel, and the controller that limits its current: speed, current or duty are commanded.

    voltage = current * resistance + back-EMF,   back-EMF = rate of the rotor / kv,   torque = current / kv

Source: any text on DC machines, as Chapman, Electric Machinery Fundamentals, chapter 8; a brushless motor with its
controller behaves as one. Rates and torques are of the wheel, after the gear; efficiency is the gear's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple, get_args

from snr_sim.plants.parameter_limits import IS_ABOVE, Limit, Record
from snr_sim.prelude.ground_signals import DriveMode

KV = Limit(0.01, 1e4, "rad/s per V", "150 rpm per V are 15.7", {"rpm per V": math.pi / 30.0})
ROTOR_KGM2 = Limit(0.0, 0.1, "kg m2", "a motor of a kilogram has 0.0001", {"g cm2": 1e-7})
FRICTION_NM = Limit(0.0, 10.0, "N m", "it is less than what the motor can")
GEAR = Limit(0.05, 1000.0, "", "it is turns of the rotor for one of the wheel")
CURRENT_A = Limit(0.0, 1000.0, "A", "a rover's controllers give 50", {"milliamperes": 1e-3}, IS_ABOVE)
GAIN_NMS = Limit(0.0, 1e4, "N m s/rad", "it is a torque for each rad/s that is missing", {}, IS_ABOVE)
OHM = Limit(0.0, 10.0, "ohm", "motors of a rover have 0.05 to 1", {"milliohms": 1e-3}, IS_ABOVE)
SHARE = Limit(0.0, 1.0, "", "it is a share of the whole", {"percent": 1e-2}, IS_ABOVE)
MODES: tuple[str, ...] = get_args(DriveMode)


class Drive(NamedTuple):
    """What a motor does in a step: torque = gain * value - slope * rate, within limits, and dry friction besides."""

    value: float = 0.0
    gain_nm: float = 0.0  # for each unit of the value
    slope_nms: float = 0.0
    friction_nm: float = 0.0


@dataclass(frozen=True)
class DcMotor(Record, who="The motor's "):
    """Parameters.

    Args:
        kv_radps_per_v: rate of the rotor for each volt of back-EMF.
        resistance_ohm: of windings, cable and controller.
        rotor_kgm2: inertia of the rotor.
        friction_nm: of bearings and gear, at the wheel.
        gear: turns of the rotor for one of the wheel.
        efficiency: of the gear; as if it were the same in both directions.
        limit_a: current that the controller allows.
        gain_nms: of the controller's speed loop.
    """

    kv_radps_per_v: Annotated[float, KV]
    resistance_ohm: Annotated[float, OHM]
    rotor_kgm2: Annotated[float, ROTOR_KGM2]
    friction_nm: Annotated[float, FRICTION_NM]
    gear: Annotated[float, GEAR]
    efficiency: Annotated[float, SHARE]
    limit_a: Annotated[float, CURRENT_A]
    gain_nms: Annotated[float, GAIN_NMS]

    @property
    def nm_per_a(self) -> float:
        """Torque at the wheel for each ampere."""
        return self.gear * self.efficiency / self.kv_radps_per_v

    @property
    def v_per_radps(self) -> float:
        """Back-EMF for each rad/s of the wheel."""
        return self.gear / self.kv_radps_per_v

    @property
    def wheel_kgm2(self) -> float:
        """Inertia of the rotor as the wheel feels it."""
        return self.rotor_kgm2 * self.gear * self.gear

    def top_radps(self, battery_v: float) -> float:
        """Return the rate of a wheel without load."""
        return battery_v / self.v_per_radps

    def drive(self, mode: str, value: float, battery_v: float) -> Drive:
        """Return what a command means at a voltage of the battery.

        Args:
            mode: one of `MODES`.
            value: rad/s of the wheel, A, or -1 to 1 of the voltage; of a brake, A. Clamped to what it can do.
            battery_v: at the controllers.
        """
        friction_nm = self.friction_nm
        if mode == "speed":
            top = self.top_radps(battery_v)
            return Drive(min(top, max(-top, value)), self.gain_nms, self.gain_nms, friction_nm)
        if mode == "current":
            return Drive(min(self.limit_a, max(-self.limit_a, value)), self.nm_per_a, 0.0, friction_nm)
        if mode == "duty":
            per_v = self.nm_per_a / self.resistance_ohm
            return Drive(min(1.0, max(-1.0, value)), per_v * battery_v, per_v * self.v_per_radps, friction_nm)
        if mode == "brake":
            return Drive(friction_nm=friction_nm + self.nm_per_a * min(self.limit_a, abs(value)))
        return Drive(friction_nm=friction_nm)

    def limits_nm(self, rate_radps: float, battery_v: float) -> tuple[float, float]:
        """Return the least and the largest torque at a rate: limits of the current, and of the voltage that is left."""
        back_v, limit_a = rate_radps * self.v_per_radps, self.limit_a
        forward_a = min(limit_a, max(0.0, (battery_v - back_v) / self.resistance_ohm))
        backward_a = min(limit_a, max(0.0, (battery_v + back_v) / self.resistance_ohm))
        return -backward_a * self.nm_per_a, forward_a * self.nm_per_a
