"""Readings and commands that plants and devices exchange, independent of their encoding on a wire.

Plants return them (true values), simulated sensors add errors, real ones measure them; the loops convert them to pages
with the same field names. `stamp_s` of a reading is when it was measured.
"""

from __future__ import annotations

import math

import msgspec


class RadarReading(msgspec.Struct, frozen=True):
    """Height over the ground below and its rate, as a radar altimeter gives them.

    Args:
        altitude_m: of the foot pads over the ground, never below 0 except for noise.
        velocity_mps: vertical, up positive.
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
    """

    position_m: list[float]
    velocity_mps: list[float]
    attitude_rad: float
    rate_radps: float
    fuel_kg: float
    contact: list[bool]
    stamp_s: float


class EngineCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Command of a lunar module's engine and jets.

    Args:
        throttle: 0 off to 1 full thrust.
        gimbal_rad: angle of the nozzle; positive makes a positive (counter-clockwise) torque.
        attitude: -1 to 1, fraction of the largest couple of the attitude jets; positive counter-clockwise.
    """

    throttle: float = 0.0
    gimbal_rad: float = 0.0
    attitude: float = 0.0


class PwmCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Pulses for the speed controllers of all thrusters.

    Args:
        pulses_us: high time of each thruster's pulse [microseconds]: 1500 stops, 1900 is full ahead, 1100 full astern.
            An empty list is 1500 for all.
        is_on: whether pulses are sent at all. Without them the speed controllers stop, and soon disarm.
        is_armed: whether outputs may follow. False disarms them, at neutral.
        is_stop: emergency stop: neutral, and arming is refused until a command without it arrives.
        until_s: when outputs go to neutral automatically, by the plant's time, unless a newer command has arrived.
    """

    pulses_us: list[float] = []
    is_on: bool = True
    is_armed: bool = True
    is_stop: bool = False
    until_s: float = math.inf


class AppliedPulses(msgspec.Struct, frozen=True):
    """Applied pulses of servo outputs, and why they differ from the command.

    Args:
        pulses_us: of each channel, as far as is known here.
        stamp_s: of the applied command.
        reason: empty if they equal the command; else some of the constants below.
    """

    pulses_us: list[float]
    stamp_s: float
    reason: list[str] = []


# Why applied pulses differ from the command.
CLAMPED = "clamped"  # to the limits
SLEWING = "slewing"  # still changing, at the permitted rate
NO_PULSE = "no pulse"  # NaN, infinite, None, text: all are neutral
WRONG_COUNT = "wrong count"  # fewer or more than channels: all are neutral
TOO_OLD = "too old"  # the lease of the newest command has expired: all are neutral
NOT_ACTIVE = "not active"  # not armed, or disarmed automatically since: all are neutral
STOPPED = "stopped"  # by the emergency stop
RESET = "reset"  # the microcontroller has restarted, and the outputs have not been armed since
LOST = "lost"  # the wire is gone: the state of the outputs is unknown; neutral if they fail safe alone


class DepthReading(msgspec.Struct, frozen=True):
    """Measurement of a pressure sensor in the water, and the depth computed from it.

    Args:
        depth_m: positive down, of the sensor.
        pressure_pa: absolute.
        temperature_c: of the water.
    """

    depth_m: float
    pressure_pa: float
    temperature_c: float
    stamp_s: float


class ImuReading(msgspec.Struct, frozen=True):
    """Measurement of an inertial unit, and the attitude that it computes from it. Body frame.

    Args:
        rate_radps: [x, y, z] angular velocity.
        specific_force_mps2: [x, y, z] of the accelerometer: [0, 0, 9.81] at rest and upright.
        field_ut: [x, y, z] of the magnetometer [microtesla].
        roll_rad: about x, positive when the left side rises.
        pitch_rad: about y, positive when the nose goes down.
        yaw_rad: about z, positive when the nose goes left; 0 to the east, -pi (left out) to pi.
    """

    rate_radps: list[float]
    specific_force_mps2: list[float]
    field_ut: list[float]
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    stamp_s: float


class EchoReading(msgspec.Struct, frozen=True):
    """Distance to the object from which an echo sounder gets its echo.

    Args:
        distance_m: along its axis; meaningless without confidence.
        confidence: 0 no echo to 1 certain.
    """

    distance_m: float
    confidence: float
    stamp_s: float


class TouchReading(msgspec.Struct, frozen=True):
    """Whether the touch bars at the front of a vehicle are pressed."""

    left: bool
    right: bool
    stamp_s: float


class WheelReading(msgspec.Struct, frozen=True):
    """How far wheels have turned since the start, as encoders count it.

    Args:
        angle_rad: of each wheel, left and right; forward positive, with full turns.
    """

    angle_rad: list[float]
    stamp_s: float


class MotorCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Speeds of the two motors of a vehicle, by the letters of their sockets.

    Args:
        a: of the left wheel, in percent of full speed: -100 to 100, forward positive.
        d: of the right wheel.
    """

    a: float = 0.0
    d: float = 0.0


class PoseReading(msgspec.Struct, frozen=True):
    """Position and heading of a vehicle on a floor, as markers in its yard give them.

    Args:
        position_m: [x, y], world frame.
        heading_rad: 0 to the east, positive to the left; full turns count.
    """

    position_m: list[float]
    heading_rad: float
    stamp_s: float


class Ball(msgspec.Struct, frozen=True):
    """A ball that cameras see.

    Args:
        center_m: x, y, z, world frame.
        radius_m: of it.
        rgb: color, 0 to 255.
    """

    center_m: tuple[float, float, float]
    radius_m: float
    rgb: tuple[int, int, int]


class ViewReading(msgspec.Struct, frozen=True):
    """What a simulated camera needs besides the static scene.

    Args:
        position_m: [x, y, z] of the vehicle, world frame.
        attitude: [w, x, y, z] unit quaternion that turns vectors of the body into the world's.
        balls: that move in the scene.
    """

    position_m: list[float]
    attitude: list[float]
    balls: list[Ball]
    stamp_s: float


class DozerCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Command of a tracked vehicle with a blade. Neutral: it stands, and the blade is up.

    Args:
        left_mps, right_mps: speeds of the tracks, forward positive.
        blade: 0 up to 1 down.
    """

    left_mps: float = 0.0
    right_mps: float = 0.0
    blade: float = 0.0


class PowerReading(msgspec.Struct, frozen=True):
    """Measurement of a power module at the battery.

    Args:
        voltage_v: under load.
        current_a: out of the battery.
    """

    voltage_v: float
    current_a: float
    stamp_s: float


class GpsReading(msgspec.Struct, frozen=True):
    """Report of a satellite navigation receiver. None: not reported.

    Args:
        latitude_deg: north positive.
        longitude_deg: east positive.
        altitude_m: above sea level.
        speed_mps: over ground.
        course_rad: direction of motion: 0 to the east, positive to the left, as yaw.
        satellites: that were used.
        hdop: horizontal dilution of precision; below 2 is good.
        stamp_s: when it was reported.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None
    speed_mps: float | None
    course_rad: float | None
    satellites: int
    hdop: float | None
    stamp_s: float


class LeakReading(msgspec.Struct, frozen=True):
    """Whether a probe in the hull is wet.

    Args:
        is_wet: it is, or has been: a probe does not dry under water.
    """

    is_wet: bool
    stamp_s: float


class GamepadReading(msgspec.Struct, frozen=True):
    """Positions of the sticks and buttons of a game controller, numbered as by the operating system.

    Args:
        axes: -1 to 1 each. A stick at rest is near 0; a trigger rests at -1, and many show 0 until first touched.
        buttons: whether each is pressed.
        hats: [x, y] of each cross of buttons: -1, 0 or 1, up and right positive.
        is_connected: whether there is a pad. If not, all values are at rest.
        stamp_s: when it was read.
    """

    axes: list[float]
    buttons: list[bool]
    hats: list[list[int]]
    is_connected: bool = True
    stamp_s: float = 0.0
