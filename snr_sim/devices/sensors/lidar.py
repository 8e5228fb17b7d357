"""A lidar that turns about the vertical: distances around a vehicle, in one plane."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from snr_sim.devices.readings import SensorErrors, SimSensor
from snr_sim.devices.sensors.camera import rotate_vector
from snr_sim.devices.sensors.ray_casting import Rays, intersect_scene
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.plant import Plant


class LidarReading(msgspec.Struct, frozen=True):
    """Distances of one turn."""

    ranges_m: list[float]  # to the first hit of each ray; the reach where there is none
    angles_rad: list[float]  # of each ray, 0 ahead, positive to the left
    stamp_s: float  # capture time


@dataclass(frozen=True)
class Lidar:
    """The part. All numbers are our own choice.

    Args:
        rays: in a turn.
        field_of_view_rad: from the rightmost ray to the leftmost one, in front.
        reach_m: beyond which there is no echo.
        noise_m: standard deviation of a distance.
        period_s: time between two turns.
        mount_position_m: its position, body frame.

    Raises:
        ParameterError: a number is out of range.
    """

    rays: int = 181
    field_of_view_rad: float = math.pi
    reach_m: float = 8.0
    noise_m: float = 0.01
    period_s: float = 0.1
    mount_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not 2 <= self.rays <= 4096:
            raise ParameterError(f"A lidar cannot have {self.rays} rays.", fix="use 2 to 4096, for example 181.")
        sizes = {"field_of_view_rad": 2.0 * math.pi, "reach_m": 1000.0, "period_s": 1000.0}
        for name, largest in sizes.items():
            if not 0.0 < getattr(self, name) <= largest:
                raise ParameterError(
                    f"Lidar {name} is {getattr(self, name)!r}.", fix=f"use more than 0 and at most {largest:g}."
                )

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Open the lidar in a plant; it meets what `Camera.simulated` sees."""
        statics = plant.scene()["statics"]
        half = 0.5 * self.field_of_view_rad
        angles = [half * (2.0 * i / (self.rays - 1) - 1.0) for i in range(self.rays)]
        ahead = np.array([math.cos(angle) for angle in angles])
        left = np.array([math.sin(angle) for angle in angles])

        def measure(pose: Any) -> LidarReading:
            x_axis, y_axis = (rotate_vector(pose.attitude, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
            directions = [ahead * x_axis[i] + left * y_axis[i] for i in range(3)]
            offset = rotate_vector(pose.attitude, self.mount_position_m)
            x, y, z = (at + more for at, more in zip(pose.position_m, offset, strict=True))
            rays = Rays((x, y, z), (directions[0], directions[1], directions[2]), 1e-3)
            intersect_scene(rays, statics, getattr(pose, "balls", ()))
            return LidarReading(np.minimum(rays.depths, self.reach_m).tolist(), angles, pose.stamp_s)

        errors = SensorErrors(
            noise={"ranges_m": self.noise_m}, limits={"ranges_m": (0.0, self.reach_m)}, period_s=self.period_s
        )
        return SimSensor(plant, output, errors, rng, measure)
