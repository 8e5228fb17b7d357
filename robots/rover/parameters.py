"""The numbers of the rover; those of its body are in vehicles/, each with its source. [O]: our own choice."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from snr_sim.devices import GpsReceiver, InertialUnit, Lidar, SensorErrors
from snr_sim.devices.emulated import Replug
from snr_sim.links import LinkFaults
from snr_sim.plants import RoverVehicle, read_rover
from snr_sim.signals import NEUTRAL_BRAKE_A
from snr_sim.teleop import Cue

MOTOR_ERRORS = SensorErrors(
    noise={"current_a": 0.05, "voltage_v": 0.02},  # [O]
    resolution={
        "speed_radps": 0.01,
        "current_a": 0.01,
        "voltage_v": 0.1,
        "turned_rad": 0.0046,
    },  # 6 x 228 counts a turn
)


@cache
def vehicle(name: str = "competition") -> RoverVehicle:
    """Return a vehicle of the folder vehicles/."""
    return read_rover(Path(__file__).parent / "vehicles" / f"{name}.toml")


@dataclass(frozen=True)
class RoverParameters:
    """Parameters of the robot for a controller."""

    vehicle: RoverVehicle = field(default_factory=vehicle)
    erpm_per_rpm: float = 228.0  # turns of a motor's field in one of its wheel: 12 pole pairs, a gear of 19
    controller_erpm: float = 40_000.0  # the limit of the motors' controllers
    neutral_a: float = NEUTRAL_BRAKE_A
    imu: InertialUnit = field(default_factory=InertialUnit)
    gps: GpsReceiver = field(default_factory=GpsReceiver)
    gps_hz: float = 0.0  # readings of the receiver, which reports 10 times a second; 0: there is none
    route: tuple[tuple[float, float], ...] = ()  # latitude and longitude of way points [degrees]
    lidar: Lidar = field(
        default_factory=lambda: Lidar(181, math.radians(358.0), 8.0, 0.02, 0.1, (0.0, 0.0, 0.4))
    )  # [O]
    scan_hz: float = 0.0  # readings of the lidar; 0: there is none
    points_m: tuple[tuple[float, float], ...] = ()  # where to go: x ahead of the start, y to the left
    stands_s: float = 3.0  # at the start, while the bias of the gyroscope is measured
    replugs: tuple[Replug, ...] = ()  # plugs of controllers that are pulled and put back
    arm_hz: float = 10.0  # readings of the joints, where the vehicle has an arm
    arm_line_m: tuple[float, float, float] = (0.0, 0.4, 0.7)  # for its wrist: height, and radius from and to
    script: tuple[Cue, ...] = ()  # what the pilot does, where there is no person; empty: there is no pilot
    command_hz: float = 20.0  # how often the surface sends controls [O]
    # Wi-Fi outdoors within a few hundred meters [O].
    radio: LinkFaults = field(default_factory=lambda: LinkFaults(latency_s=0.005, jitter_s=0.005))
    port: int = 9130  # of the link, when it is a real one
    motors_hz: float = 20.0  # readings of each motor's controller [O]
    imu_hz: float = 50.0  # [O]
    power_hz: float = 2.0  # [O]
    drive_hz: float = 50.0  # how often a command is written [O]
    drive_timeout_s: float = 0.2  # controls older than this are a brake: of 20 a second, three may be lost [O]
    limit_mps: float = 1.5  # speed of a full stick; its motors can 2 [O]
    limit_radps: float = 0.25 * math.pi  # rate of turning of a full stick [O]
    tyre_m: float = 0.0045  # the rolling radius is that much less: half of what the load presses in (PHYSICS.md)

    @property
    def motor_limits(self) -> dict[str, float]:
        """Largest amount of a wheel's value in each mode: rad/s, A, or 1, all of the voltage."""
        motor = self.vehicle.motor
        top_radps = self.controller_erpm / self.erpm_per_rpm * math.pi / 30.0
        return {"speed": top_radps, "current": motor.limit_a, "brake": motor.limit_a, "duty": 1.0}
