"""Inputs of an underwater vehicle's sensors: the true values, before sensor errors.

These are the plant's outputs. A sensor's reading is another record (`prelude/signals.py`): a depth sensor measures
pressure and computes depth from it, as the real part does.

    output "depth"     DepthOutput       output "power"   PowerOutput
    output "imu"       ImuOutput         output "leak"    LeakOutput
    output "altitude"  AltitudeOutput    output "pose"    PoseOutput

Frames: world x east, y north, z up; body x forward, y left, z up.
"""

from __future__ import annotations

import msgspec


class DepthOutput(msgspec.Struct, frozen=True):
    """The water at the pressure port.

    Args:
        depth_m: of the port under the surface at rest; negative above it.
        sink_mps: rate of depth, positive while going down.
        pressure_pa: absolute; the air's above the surface.
        temperature_c: of the water.
        stamp_s: when.
    """

    depth_m: float
    sink_mps: float
    pressure_pa: float
    temperature_c: float
    stamp_s: float


class ImuOutput(msgspec.Struct, frozen=True):
    """Motion and field where the inertial unit is mounted, its axes along the body's; the attitude it finds itself.

    Args:
        rate_radps: [x, y, z] angular velocity, body frame.
        specific_force_mps2: [x, y, z] acceleration less gravity, body frame: [0, 0, 9.81] at rest and upright.
        field_ut: [x, y, z] magnetic field, body frame [microtesla], with what the thrusters' currents add.
        stamp_s: when.
    """

    rate_radps: list[float]
    specific_force_mps2: list[float]
    field_ut: list[float]
    stamp_s: float


class AltitudeOutput(msgspec.Struct, frozen=True):
    """What is under the echo sounder.

    Args:
        altitude_m: height of the sounder over the floor, straight down.
        tilt_rad: angle between the sounder's axis and straight down, 0 to pi.
        stamp_s: when.
    """

    altitude_m: float
    tilt_rad: float
    stamp_s: float


class PoseOutput(msgspec.Struct, frozen=True):
    """Position of the vehicle's origin and its attitude: for a camera's image.

    Args:
        position_m: [x, y, z], world frame.
        attitude: [w, x, y, z] unit quaternion that turns vectors of the body into the world's.
        stamp_s: when.
    """

    position_m: list[float]
    attitude: list[float]
    stamp_s: float


class PowerOutput(msgspec.Struct, frozen=True):
    """The battery's terminals.

    Args:
        voltage_v: at the terminals, under load.
        current_a: out of the battery.
        charge: what is left of it, 0 empty to 1 full.
        stamp_s: when.
    """

    voltage_v: float
    current_a: float
    charge: float
    stamp_s: float


class LeakOutput(msgspec.Struct, frozen=True):
    """Water where none should be.

    Args:
        water_l: litres inside the hull; they weigh as much in kilograms.
        stamp_s: when.
    """

    water_l: float
    stamp_s: float
