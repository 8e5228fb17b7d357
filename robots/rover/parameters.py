"""The numbers of the rover; those of its body are in vehicles/, each with its source. [O]: our own choice."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from snr_sim.devices import InertialUnit, SensorErrors
from snr_sim.plants import RoverVehicle, read_rover

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
    imu: InertialUnit = field(default_factory=InertialUnit)
    motors_hz: float = 20.0  # readings of each motor's controller [O]
    imu_hz: float = 50.0  # [O]
    power_hz: float = 2.0  # [O]
    drive_hz: float = 50.0  # how often a command is written [O]
    drive_timeout_s: float = 0.25  # a command older than this is a brake [O]
