"""The numbers of this underwater vehicle: sensors, gains, limits. Its hydrodynamics are in vehicles/*.toml.

Gains are our own choice, for the vehicle in benzon2022.toml: mass with water 32 kg in heave, inertia with water 0.45,
0.36 and 0.59 kg m2. The delay round the loop is about 60 ms: sensor and control 20 each, thruster 29. Control answers
every reading of the inertial unit. That could be read twice as often, which would cost as much more and change little.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from snr_sim.devices import Camera, EchoSounder, InertialUnit, LeakProbe, Ms5837, PowerModule
from snr_sim.errors import ParameterError, suggest
from snr_sim.links import LinkFaults
from snr_sim.plants import DEGREES, IS_ABOVE, Limit, Vehicle, check_number, check_record, format_value, read_vehicle
from snr_sim.plants.urov.t200 import MAX_VOLTAGE_V, MIN_VOLTAGE_V
from snr_sim.scenario import AXES
from snr_sim.teleop import Cue

from .failsafe_monitor import FailsafeLimits
from .failsafes import Failsafes
from .tether_link import tether_faults
from .waypoint_pilot import Waypoint

PARTS = ("depth", "imu", "altitude", "power", "leak")
# fmt: off
GAIN = Limit(0.0, 1e5, "", "gains are given without a minus sign, and a vehicle of this size has some tens")
PUSH = Limit(0.0, 1e3, "", "eight of its thrusters give some 200 N")
OUTPUT_LIMIT = Limit(0.0, 1e3, "", "the most that a controller asks for: eight thrusters give some 200 N", {}, IS_ABOVE)
RATE = Limit(0.0, 1000.0, "Hz", "10 to 50 is usual", {}, IS_ABOVE)
FIX = Limit(0.0, 100.0, "Hz", "1 to 5 is usual, and 0 where there is none")
VOLTS = Limit(MIN_VOLTAGE_V, MAX_VOLTAGE_V, "V", "14.8 is usual, with 4 cells", {"millivolts": 1e-3})
SLEW = Limit(0.0, 1e5, "N/s", "250 is usual", {}, IS_ABOVE)
PORT = Limit(1, 65535, "", "9120 is usual, and both ends of a link must know it")
# fmt: on
EXAMPLE_FAILSAFES = 'Failsafes(link_lost="surface").'
EXAMPLE_GAINS = "Gains(kp=8.0, ki=1.5, kd=4.0, output_limit=8.0)"
VEHICLES = Path(__file__).parent / "vehicles"


@dataclass(frozen=True)
class Gains:
    """Of a PID controller; its output is a force [N] or a moment [N m]."""

    kp: Annotated[float, GAIN]
    ki: Annotated[float, GAIN]
    kd: Annotated[float, GAIN]
    output_limit: Annotated[float, OUTPUT_LIMIT]

    def __post_init__(self) -> None:
        check_record(self, "The gain ")


@dataclass(frozen=True)
class HoldParameters:
    """Parameters of the depth and heading holds. A number that is out of range raises a ParameterError."""

    # On errors in metres and radians; `level` is of roll and pitch.
    depth: Annotated[Gains, EXAMPLE_GAINS] = Gains(kp=120.0, ki=40.0, kd=70.0, output_limit=70.0)
    heading: Annotated[Gains, EXAMPLE_GAINS] = Gains(kp=8.0, ki=1.5, kd=4.0, output_limit=8.0)
    level: Annotated[Gains, EXAMPLE_GAINS] = Gains(kp=8.0, ki=2.0, kd=3.0, output_limit=8.0)
    # What full sticks push in surge, sway and heave, and what one turns with.
    sticks_n: Annotated[tuple[float, float, float], PUSH, ("surge", "sway", "heave")] = (60.0, 60.0, 60.0)
    yaw_nm: Annotated[float, Limit(0.0, 1e3, "N m", "6 is usual")] = 6.0
    # How fast a held depth moves, at full stick or towards another one, and how it slows down before it arrives.
    sink_mps: Annotated[float, Limit(0.0, 5.0, "m/s", "0.35 is usual", {"centimetres a second": 1e-2}, IS_ABOVE)] = 0.35
    brake_mps2: Annotated[float, Limit(0.0, 10.0, "m/s2", "0.1 is usual", {}, IS_ABOVE)] = 0.1
    # How far from where the vehicle is a stick moves it at most; more than it takes to slow down.
    max_lead_m: Annotated[float, Limit(0.0, 20.0, "m", "1 is usual", {"centimetres": 1e-2}, IS_ABOVE)] = 1.0
    # The same of a held heading.
    turn_radps: Annotated[float, Limit(0.0, 10.0, "rad/s", "0.7 is usual", DEGREES, IS_ABOVE)] = 0.7
    brake_radps2: Annotated[float, Limit(0.0, 10.0, "rad/s2", "0.4 is usual", DEGREES, IS_ABOVE)] = 0.4

    def __post_init__(self) -> None:
        check_record(self, "The hold's ")


@dataclass(frozen=True)
class Sensors:
    """The parts, and how often each is read. No camera unless one is given: it takes longer than all others."""

    depth: Annotated[Ms5837, "Ms5837()"] = field(default_factory=Ms5837)
    imu: Annotated[InertialUnit, "InertialUnit()"] = field(default_factory=InertialUnit)
    altitude: Annotated[EchoSounder, "EchoSounder()"] = field(default_factory=EchoSounder)
    power: Annotated[PowerModule, "PowerModule()"] = field(default_factory=PowerModule)
    leak: Annotated[LeakProbe, "LeakProbe()"] = field(default_factory=LeakProbe)
    camera: Annotated[Camera | None, 'Camera("down"), or None.'] = None
    rates_hz: dict[str, float] = field(
        default_factory=lambda: {"depth": 20.0, "imu": 50.0, "altitude": 10.0, "power": 5.0, "leak": 2.0}
    )

    def __post_init__(self) -> None:
        check_record(self, "The sensor ")
        if not isinstance(self.rates_hz, dict):
            raise ParameterError(f"The sensors' rates_hz is {format_value(self.rates_hz)}.", fix='{"depth": 20.0, ...}')
        for name in self.rates_hz:
            if name not in PARTS:
                raise ParameterError(
                    f"rates_hz has {format_value(name)}, which is not a sensor of this vehicle.",
                    fix=suggest(str(name), PARTS),
                )
        for name in PARTS:
            if name not in self.rates_hz:
                raise ParameterError(
                    f"rates_hz has no entry for '{name}'.", fix=f'all of them are read: {{..., "{name}": 10.0}}.'
                )
            check_number(f"rates_hz of '{name}'", self.rates_hz[name], RATE)


@dataclass(frozen=True)
class UrovParameters:
    """Parameters of the vehicle for a controller. A number that is out of range raises a ParameterError."""

    vehicle: Vehicle
    script: tuple[Cue, ...] = ()  # what the pilot does, where there is no person
    route: tuple[Waypoint, ...] = ()  # of a pilot who sees the vehicle; if there is one, it replaces the script
    sensors: Sensors = field(default_factory=Sensors)
    holds: HoldParameters = field(default_factory=HoldParameters)
    failsafe_limits: FailsafeLimits = field(default_factory=FailsafeLimits)
    failsafes: Annotated[Failsafes, EXAMPLE_FAILSAFES] = field(default_factory=Failsafes)
    fix_hz: Annotated[float, FIX] = 0.0  # rate of position fixes, as of an acoustic positioning system; 0: none
    nominal_v: Annotated[float, VOLTS] = 14.8  # at which the pulse for a thrust is looked up
    slew_nps: Annotated[float, SLEW] = 250.0  # how fast a thrust may change
    # Axes that are served before the others when thrusters are at their limits.
    priority_axes: tuple[str, ...] = ("heave", "roll", "pitch", "yaw")
    command_hz: Annotated[float, RATE] = 20.0  # how often the surface sends controls
    pwm_hz: Annotated[float, RATE] = 50.0  # how often pulses are written
    tether: LinkFaults = field(default_factory=lambda: tether_faults(35.0))  # faults of the link through it
    port: Annotated[int, PORT] = 9120  # of the link, when it is a real one

    def __post_init__(self) -> None:
        check_record(self, "")
        for axis in (self.priority_axes,) if isinstance(self.priority_axes, str) else self.priority_axes:
            if axis not in AXES:
                raise ParameterError(
                    f"priority_axes has {format_value(axis)}, which is not an axis.", fix=suggest(str(axis), AXES)
                )


def vehicle(name: str = "benzon2022") -> Vehicle:
    """Return the numbers of a vehicle in `vehicles/`."""
    return read_vehicle(VEHICLES / f"{name}.toml")


def failsafe_lines(parameters: UrovParameters) -> list[str]:
    """Return the vehicle's actions for failures, in few lines."""
    return [f"failsafe  {line}" for line in parameters.failsafes.lines(parameters.failsafe_limits.hold_s)]
