"""A small camera that looks ahead or down, without noise. Its image is a numpy array in the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from snr_sim.devices.readings import SensorErrors, SensorLoopFactory, SimSensor
from snr_sim.devices.sensors.ray_casting import (
    BACKSCATTER_PER_M,
    NEAREST_M,
    Floats,
    Image,
    Point,
    Rays,
    intersect_scene,
)
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import Ball
from snr_sim.prelude.task import snapshot

# Axis, right and down of the image, body frame. Looking down, the top of the image is ahead.
DIRECTIONS = {
    "ahead": ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)),
    "down": ((0.0, 0.0, -1.0), (0.0, -1.0, 0.0), (-1.0, 0.0, 0.0)),
}
MEDIA = ("water", "air")


class CameraReading(msgspec.Struct, frozen=True, eq=False):
    """An image."""

    rgb: Image  # uint8, shape (height, width, 3): the top row first, its left pixel first; read-only
    field_of_view_rad: float  # from the left edge to the right one
    stamp_s: float  # capture time


@dataclass(frozen=True)
class Camera:
    """The part: a pinhole camera without distortion. All numbers are our own choice; a larger image takes longer.

    Args:
        direction: "ahead" or "down".
        width_px, height_px: of the image.
        field_of_view_rad: from the left edge to the right one.
        period_s: time between two images.
        mount_position_m: its position, body frame.
        backscatter_per_m: scattering of the water in front of it; murky water has 1 and more.
        clouds: (start_s, end_s, backscatter_per_m) of each period with other water.
        medium: "water", or "air", which neither absorbs nor veils.

    Raises:
        UnknownNameError: `direction` or `medium` has another value.
        ParameterError: a number is out of range.
    """

    direction: str = "ahead"
    width_px: int = 64
    height_px: int = 48
    field_of_view_rad: float = math.radians(80.0)
    period_s: float = 0.2
    mount_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    backscatter_per_m: float = BACKSCATTER_PER_M
    clouds: tuple[tuple[float, float, float], ...] = ()
    medium: str = "water"

    def __post_init__(self) -> None:
        for what, value, known in (("direction", self.direction, DIRECTIONS), ("medium", self.medium, MEDIA)):
            if value not in known:
                raise UnknownNameError(f"{value!r} is not a valid {what} of a camera.", fix=suggest(value, known))
        if not (1 <= self.width_px <= 1024 and 1 <= self.height_px <= 1024):
            raise ParameterError(
                f"A camera cannot have {self.width_px} x {self.height_px} pixels.",
                fix="use 1 to 1024 each way, for example 64 x 48.",
            )
        if not 0.0 < self.field_of_view_rad < math.radians(170.0):
            raise ParameterError(
                f"Camera field_of_view_rad is {self.field_of_view_rad!r}.",
                fix="use a value greater than 0 and less than 2.96.",
            )
        if not 0.0 < self.period_s < math.inf:
            raise ParameterError(
                f"Camera period_s must be positive and finite, not {self.period_s!r}.",
                fix="use the time between two images, for example period_s=0.2.",
            )
        for backscatter_per_m in (self.backscatter_per_m, *(cloud[2] for cloud in self.clouds)):
            if not 0.0 <= backscatter_per_m < math.inf:
                raise ParameterError(
                    f"Camera backscatter_per_m must be 0 or more and finite, not {backscatter_per_m!r}.",
                    fix="0.06 is a clean pool.",
                )

    @property
    def pixel(self) -> float:
        """Width of a pixel, 1 m away."""
        return 2.0 * math.tan(0.5 * self.field_of_view_rad) / self.width_px

    def picture(
        self,
        statics: dict[str, Any],
        position_m: list[float],
        attitude: list[float],
        time_s: float = -math.inf,
        balls: Sequence[Ball] = (),
    ) -> Image:
        """Return the image of a scene's `statics` from a vehicle at a position.

        Args:
            statics: shapes by name, as `Plant.scene()` gives them.
            position_m: of the vehicle, world frame.
            attitude: [w, x, y, z] unit quaternion that turns vectors of the body into the world's.
            time_s: capture time, which selects a cloud.
            balls: that move in the scene.
        """
        clouds = [veil for start_s, end_s, veil in self.clouds if start_s <= time_s < end_s]
        offset = rotate_vector(attitude, self.mount_position_m)
        origin = position_m[0] + offset[0], position_m[1] + offset[1], position_m[2] + offset[2]
        axes = [rotate_vector(attitude, vector) for vector in DIRECTIONS[self.direction]]
        rays = PixelRays(origin, axes, (self.width_px, self.height_px), self.pixel)
        intersect_scene(rays, statics, balls)
        veil = clouds[0] if clouds else self.backscatter_per_m
        rgb = rays.through_air() if self.medium == "air" else rays.through_water(veil)
        rgb.flags.writeable = False
        return rgb

    def simulated(self, plant: Plant, output: str, rng: np.random.Generator) -> SimSensor:
        """Open the camera in a plant; it sees the static part of its scene, and the `balls` of the output, if any."""
        statics = plant.scene()["statics"]

        def capture(pose: Any) -> CameraReading:
            balls = getattr(pose, "balls", ())
            rgb = self.picture(statics, pose.position_m, pose.attitude, pose.stamp_s, balls)
            return CameraReading(rgb, self.field_of_view_rad, pose.stamp_s)

        return SimSensor(plant, output, SensorErrors(period_s=self.period_s), rng, capture)


class PixelRays(Rays):
    """One ray per pixel. `axes` are axis, right and down of the image, world frame; `pixel` is its width, 1 m away."""

    def __init__(self, origin_m: Point, axes: Sequence[Point], size_px: tuple[int, int], pixel: float) -> None:
        self._axes, self._size_px = np.array(axes).T, size_px
        self._rights, self._downs = ((np.arange(count) - 0.5 * (count - 1)) * pixel for count in size_px)
        in_columns, in_rows = self.along(np.eye(3))
        x, y, z = in_columns[:, None, :] + in_rows[:, :, None]
        super().__init__(origin_m, (x, y, z), pixel)

    def grid_size(self) -> tuple[int, int]:
        """See `Rays.grid_size`."""
        width, height = self._size_px
        return height, width

    def along(self, vectors: Floats) -> tuple[Floats, Floats]:
        """See `Rays.along`; only one part of the sum depends on the column, and one on the row."""
        aheads, rights, downs = self._in_axes(vectors)[..., None]
        return aheads + rights * self._rights, downs * self._downs

    def blocks_of(self, corners: Floats, radii_m: Any = 0.0) -> Any:
        """See `Rays.blocks_of`."""
        aheads, rights, downs = self._in_axes(corners)
        offsets = np.array((downs, rights))
        near, far = aheads - radii_m, aheads + radii_m
        lows, highs = offsets - radii_m, offsets + radii_m
        # Of what is in front of the camera; a part that is not is nowhere in the image.
        starts = (lows / np.where(lows > 0.0, far, near)).min(axis=1) / self.pixel
        stops = (highs / np.where(highs > 0.0, near, far)).max(axis=1) / self.pixel
        counts = np.array(self.grid_size())[:, None]
        middles = 0.5 * (counts - 1)
        is_near, is_behind = near.min(axis=0) <= NEAREST_M, far.max(axis=0) <= NEAREST_M
        starts = np.where(is_near, 0, np.maximum(0, np.floor(starts + middles)))
        stops = np.where(is_near, counts, np.minimum(counts, np.ceil(stops + middles) + 1))
        return np.concatenate((starts, np.where(is_behind, 0, stops))).astype(int)

    def _in_axes(self, vectors: Floats) -> Floats:
        """Return vectors of shape (3, ...) by axis, right and down of the image."""
        i, j, k = self._axes.reshape(3, 3, *[1] * (vectors.ndim - 1))
        parts: Floats = i * vectors[0] + j * vectors[1] + k * vectors[2]
        return parts


class CameraLoopFactory(SensorLoopFactory):
    """Reads a camera at a rate and stores each image as a page; arguments are those of `SensorLoopFactory`."""

    def data_of(self, reading: CameraReading) -> dict[str, Any]:
        """Return the data of an image's page: a copy, as a camera may reuse its array."""
        data: dict[str, Any] = snapshot(msgspec.structs.asdict(reading), [])
        return data


def rotate_vector(attitude: list[float], vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return a vector of the body frame in the world frame."""
    w, x, y, z = attitude
    a, b, c = vector
    # v + 2 q x (q x v + w v)
    i, j, k = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
    return a + 2.0 * (y * k - z * j), b + 2.0 * (z * i - x * k), c + 2.0 * (x * j - y * i)
