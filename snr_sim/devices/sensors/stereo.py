"""Two cameras side by side. The difference between their images is the distance of what they show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from snr_sim.devices.readings import SensorErrors, SimSensor
from snr_sim.devices.sensors.camera import Camera
from snr_sim.devices.sensors.ray_casting import Image
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.plant import Plant


class StereoReading(msgspec.Struct, frozen=True, eq=False):
    """Two images of one moment."""

    left: Image  # uint8, shape (height, width, 3), as in `CameraReading`; read-only
    right: Image
    baseline_m: float  # between the cameras
    field_of_view_rad: float  # of each, from the left edge to the right one
    stamp_s: float  # capture time


@dataclass(frozen=True)
class StereoCamera:
    """The part: two equal cameras that look in parallel.

    Args:
        camera: each of them; its mount position is the middle between both.
        baseline_m: between them: left and right in the body frame.

    Raises:
        ParameterError: the distance is not positive.
    """

    camera: Camera
    baseline_m: float = 0.12

    def __post_init__(self) -> None:
        if not 0.0 < self.baseline_m < 10.0:
            raise ParameterError(
                f"StereoCamera baseline_m is {self.baseline_m!r}.", fix="use metres, for example 0.12."
            )

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Open both cameras in a plant, as `Camera.simulated` does."""
        statics = plant.scene()["statics"]
        x, y, z = self.camera.mount_position_m
        cameras = [replace(self.camera, mount_position_m=(x, y + side * self.baseline_m, z)) for side in (0.5, -0.5)]

        def capture(pose: Any) -> StereoReading:
            balls = getattr(pose, "balls", ())
            left, right = (one.picture(statics, pose.position_m, pose.attitude, pose.stamp_s, balls) for one in cameras)
            return StereoReading(left, right, self.baseline_m, self.camera.field_of_view_rad, pose.stamp_s)

        return SimSensor(plant, output, SensorErrors(period_s=self.camera.period_s), rng, capture)
