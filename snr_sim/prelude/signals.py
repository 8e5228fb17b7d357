"""Readings and commands that plants and devices exchange: the words on the wire, without the wire.

Plants answer with these (true values), simulated sensors spoil them, real ones measure them; the loops turn them
into pages with the same field names.
"""

from __future__ import annotations

import msgspec


class RadarReading(msgspec.Struct, frozen=True):
    """Height over the ground below and its rate, as a radar altimeter gives them.

    Args:
        altitude_m: of the foot pads over the ground, never below 0 but for noise.
        velocity_mps: vertical, up positive.
        stamp_s: when it was measured.
    """

    altitude_m: float
    velocity_mps: float
    stamp_s: float


class InertialReading(msgspec.Struct, frozen=True):
    """State of a module that moves in the x-z plane, as its inertial unit gives it.

    Args:
        position_m: [x, z] of the centre of mass, world frame; x = 0 is the middle of the pad, z = 0 its surface.
        velocity_mps: [vx, vz], world frame.
        attitude_rad: 0 upright, positive counter-clockwise seen from -y (the nose goes to -x).
        rate_radps: of attitude.
        fuel_kg: left in the tank.
        contact: [left, right] foot pad touches the ground.
        stamp_s: when it was measured.
    """

    position_m: list[float]
    velocity_mps: list[float]
    attitude_rad: float
    rate_radps: float
    fuel_kg: float
    contact: list[bool]
    stamp_s: float


class EngineCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a lunar module's engine and jets are told.

    Args:
        throttle: 0 off to 1 full thrust.
        gimbal_rad: turns the nozzle; positive makes a positive (counter-clockwise) torque.
        attitude: -1 to 1, couple of the attitude jets as a share of its largest; positive counter-clockwise.
    """

    throttle: float = 0.0
    gimbal_rad: float = 0.0
    attitude: float = 0.0


class PwmCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The pulses that the speed controllers of all thrusters are sent.

    Args:
        pulses_us: high time of each thruster's pulse [microseconds]: 1500 stops, 1900 is full ahead, 1100 full astern.
            An empty list is 1500 for all.
        is_on: whether pulses are sent at all. Without them the speed controllers stop, and soon disarm.
    """

    pulses_us: list[float] = []
    is_on: bool = True


class PadReading(msgspec.Struct, frozen=True):
    """Where the sticks and buttons of a game controller are, numbered as the system numbers them.

    Args:
        axes: -1 to 1 each. A stick at rest is near 0; a trigger rests at -1, and many show 0 until first touched.
        buttons: whether each is pressed.
        hats: [x, y] of each cross of buttons: -1, 0 or 1, up and right positive.
        is_connected: whether there is a pad. If not, everything is at rest.
    """

    axes: list[float]
    buttons: list[bool]
    hats: list[list[int]]
    is_connected: bool = True
