"""The numbers of this underwater vehicle: sensors, gains, limits. Its hydrodynamics are in vehicles/*.toml.

Gains are our own choice, for the vehicle in benzon2022.toml: mass with water 32 kg in heave, inertia with water 0.45,
0.36 and 0.59 kg m2. The delay round the loop is about 60 ms: sensor and control 20 each, thruster 29. Control answers
every reading of the inertial unit. That could be read twice as often, which would cost as much more and change little.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from snr_sim.devices.camera import Camera
from snr_sim.devices.echo_sounder import EchoSounder
from snr_sim.devices.hull_watch import LeakProbe, PowerModule
from snr_sim.devices.imu import InertialUnit
from snr_sim.devices.ms5837 import Ms5837
from snr_sim.plants.vehicle import Vehicle
from snr_sim.plants.vehicle_file import read_vehicle
from snr_sim.std_mods.comms.faults import Faults

from .guard import GuardLimits
from .pilot import Cue
from .seeing_pilot import Waypoint
from .tether_link import tether_faults

VEHICLES = Path(__file__).parent / "vehicles"


@dataclass(frozen=True)
class Gains:
    """Of a PID controller; its output is a force [N] or a moment [N m]."""

    kp: float
    ki: float
    kd: float
    most: float


@dataclass(frozen=True)
class HoldNumbers:
    """How the vehicle holds what it holds.

    Args:
        depth, heading: on errors in metres and radians.
        level: of roll and pitch.
        sticks_n: what full sticks push in surge, sway and heave.
        yaw_nm: what a full stick turns with.
        sink_mps: how fast a held depth moves, at full stick or on its way to another one.
        brake_mps2: how it slows down before it arrives.
        lead_m: how far from where the vehicle is a stick moves it at most; more than it takes to slow down.
        turn_radps, brake_radps2: the same of a held heading.
    """

    depth: Gains = Gains(kp=120.0, ki=40.0, kd=70.0, most=70.0)
    heading: Gains = Gains(kp=8.0, ki=1.5, kd=4.0, most=8.0)
    level: Gains = Gains(kp=8.0, ki=2.0, kd=3.0, most=8.0)
    sticks_n: tuple[float, float, float] = (60.0, 60.0, 60.0)
    yaw_nm: float = 6.0
    sink_mps: float = 0.35
    brake_mps2: float = 0.1
    lead_m: float = 1.0
    turn_radps: float = 0.7
    brake_radps2: float = 0.4


@dataclass(frozen=True)
class Sensors:
    """The parts, and how often each is read. No camera unless one is given: it takes longer than all others."""

    depth: Ms5837 = field(default_factory=Ms5837)
    imu: InertialUnit = field(default_factory=InertialUnit)
    altitude: EchoSounder = field(default_factory=EchoSounder)
    power: PowerModule = field(default_factory=PowerModule)
    leak: LeakProbe = field(default_factory=LeakProbe)
    camera: Camera | None = None
    rates_hz: dict[str, float] = field(
        default_factory=lambda: {"depth": 20.0, "imu": 50.0, "altitude": 10.0, "power": 5.0, "leak": 2.0}
    )


@dataclass(frozen=True)
class UrovParameters:
    """What a controller may know about its vehicle.

    Args:
        vehicle: its numbers.
        script: what the pilot does, where there is no person.
        route: where a pilot who sees goes; if there is one, he flies instead.
        sensors, holds, guard: see there.
        nominal_v: at which the pulse for a thrust is looked up.
        slew_nps: how fast a thrust may change.
        first: axes that are served before the others when thrusters are at their limits.
        command_hz: how often the surface sends controls.
        pwm_hz: how often pulses are written.
        tether: what is wrong with the link through it.
        port: of the link, when it is a real one.
    """

    vehicle: Vehicle
    script: tuple[Cue, ...] = ()
    route: tuple[Waypoint, ...] = ()
    sensors: Sensors = field(default_factory=Sensors)
    holds: HoldNumbers = field(default_factory=HoldNumbers)
    guard: GuardLimits = field(default_factory=GuardLimits)
    nominal_v: float = 14.8
    slew_nps: float = 250.0
    first: tuple[str, ...] = ("heave", "roll", "pitch", "yaw")
    command_hz: float = 20.0
    pwm_hz: float = 50.0
    tether: Faults = field(default_factory=lambda: tether_faults(35.0))
    port: int = 9120


def vehicle(name: str = "benzon2022") -> Vehicle:
    """Returns the numbers of a vehicle in `vehicles/`."""
    return read_vehicle(VEHICLES / f"{name}.toml")
