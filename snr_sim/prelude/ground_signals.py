"""Readings and commands of vehicles on wheels with motors of their own; see `signals.py`.

SI and radians: rates of a rotor's field, milliamperes and encoder counts exist on a wire only.
"""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import msgspec

DriveMode: TypeAlias = Literal["speed", "current", "brake", "duty", "off"]


ARM_JOINTS = ("base", "shoulder", "elbow", "wrist_pitch", "wrist_roll", "grip")
NEUTRAL_BRAKE_A = 4.0  # of a motor without a command: holds a rover of 43 kg on slopes of up to 25 degrees


class DriveCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the motors of all wheels do.

    Args:
        mode: "speed", "current", "brake", "duty", or "off", which lets the wheels turn freely.
        values: one for each wheel, in the order of the vehicle: rad/s, A, A, -1 to 1 of the voltage, or anything. None
            at all is neutral, whatever the mode: a brake, since a rover that rolls freely drives down a slope.
        until_s: when the motors go to neutral, by the plant's time, each unless it has a newer command.
    """

    mode: DriveMode = "brake"
    values: list[float] = []
    until_s: float = math.inf


class MotorReading(msgspec.Struct, frozen=True):
    """State of a motor, as its controller gives it; rates and torques are of the wheel.

    Args:
        speed_radps: positive forward.
        current_a: through the motor, positive when it pushes forward.
        battery_a: from the battery.
        duty: voltage at the motor over that of the battery, -1 to 1.
        voltage_v: of the battery at the controller.
        turned_rad: how far the wheel has turned.
    """

    speed_radps: float
    current_a: float
    battery_a: float
    duty: float
    voltage_v: float
    turned_rad: float
    stamp_s: float


class ArmCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where the joints of an arm go to.

    Args:
        angles_rad: one for each of `ARM_JOINTS`. None at all is neutral: each stays where it is.
    """

    angles_rad: list[float] = []


class ArmReading(msgspec.Struct, frozen=True):
    """State of the joints of an arm, in the order of `ARM_JOINTS`; torques are those of the servos."""

    angles_rad: list[float]
    rates_radps: list[float]
    torques_nm: list[float]
    stamp_s: float
