"""Image of a plant's scene, one ray per pixel, in numpy alone.

MuJoCo's renderer needs OpenGL and a driver, which a Raspberry Pi or a server without a screen may lack, and each driver
rounds differently. This one uses only addition, multiplication, division and roots, which IEEE 754 rounds alike on
every machine; matrix products and `exp` are avoided, as their rounding differs. A shape is computed for those pixels
only that can show it.

It shows the static part of `scene()`, and balls that move. Water absorbs red first and green later, and veils what is
far.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from snr_sim.prelude.signals import Ball

Floats: TypeAlias = npt.NDArray[np.float64]
Image: TypeAlias = npt.NDArray[np.uint8]
Point: TypeAlias = tuple[float, float, float]

# Absorption of red, green and blue light in pure water per metre: at 650, 550 and 450 nm. Source: Pope and Fry, Applied
# Optics 36 (1997). Light travels down to the object, and then to the camera.
ATTENUATION_PER_M: Point = (0.340, 0.0565, 0.0092)
# The water between camera and object scatters light, too: our choice, for a clean pool.
BACKSCATTER_PER_M = 0.06
VEIL_RGB: Point = (90.0, 150.0, 175.0)
BACKGROUND_RGB: Point = (176.0, 196.0, 214.0)  # above water: our choice
STEEP_SHADE = 0.3  # brightness of an upright face relative to a level one: our choice
NEAREST_M = 0.01
_BOX = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))  # corners, by bits of xyz


class Rays:
    """Rays from one point.

    Args:
        origin_m: their origin.
        directions: x, y and z of each ray's direction, all of one shape, world frame; 1 m along a camera's axis.
        pixel: width of a pixel, 1 m away.
    """

    def __init__(self, origin_m: Point, directions: tuple[Floats, Floats, Floats], pixel: float) -> None:
        self.origin_m: Point = origin_m
        self.directions: tuple[Floats, Floats, Floats] = directions
        self.pixel: float = pixel
        x, y, z = directions
        self.lengths: Floats = np.sqrt(x * x + y * y + z * z)
        self.depths: Floats = np.full(x.shape, np.inf)  # of the first hit, along the camera's axis
        self.colors: Floats = np.zeros((*x.shape, 3))

    def block_of(self, corners: Sequence[Point], radius_m: float = 0.0) -> Any:
        """Return the index of the rays that can hit what is between some corners; None if there are none.

        Corners are relative to the origin, with a ball of `radius_m` around each of them.
        """
        return ...  # all, as they are in no order

    def along(self, vector: Point, block: Any) -> Any:
        """Return the scalar products of a vector and the directions of a block."""
        return _dot(self.directions, vector)

    def intersect_triangle(self, a: Point, b: Point, c: Point, rgb: list[float]) -> None:
        """Hit a flat triangle from either side."""
        a, b, c = (_subtract(corner, self.origin_m) for corner in (a, b, c))
        normal = _cross(_subtract(b, a), _subtract(c, a))
        square = _dot(normal, normal)
        block = self.block_of((a, b, c))
        if square == 0.0 or block is None:
            return
        depths = _dot(a, normal) / self.along(normal, block)
        first = (depths > NEAREST_M) & (depths < self.depths[block])
        if not first.any():
            return
        for start, end in ((a, b), (b, c), (c, a)):
            inward = _cross(normal, _subtract(end, start))
            # The edge is widened a little, so that no ray passes between two neighbours.
            first &= depths * self.along(inward, block) >= _dot(start, inward) - 1e-9 * square
        level = abs(normal[2]) / square**0.5
        self._hit(block, first, depths, [value * (1.0 - STEEP_SHADE * (1.0 - level)) for value in rgb])

    def intersect_line(self, a: Point, b: Point, radius_m: float, rgb: list[float]) -> None:
        """Hit a round bar. One that is thinner than a pixel is drawn one pixel wide, or it would flicker."""
        along, to_origin = _subtract(b, a), _subtract(self.origin_m, a)
        length2 = _dot(along, along)
        ends = _subtract(a, self.origin_m), _subtract(b, self.origin_m)
        # Half a pixel, and a little more: a bar just between two rows must show in at least one.
        min_reach = 0.505 * self.pixel
        block = self.block_of(ends, max(radius_m, *(min_reach * _dot(end, end) ** 0.5 for end in ends)))
        if length2 == 0.0 or block is None:
            return
        directions, lengths = [one[block] for one in self.directions], self.lengths[block]
        slant, back = _dot(directions, along), _dot(directions, to_origin)
        spread = lengths * lengths * length2 - slant * slant
        fractions = (lengths * lengths * _dot(to_origin, along) - slant * back) / spread
        fractions = np.clip(np.where(spread > 0.0, fractions, 0.0), 0.0, 1.0)
        depths = (fractions * slant - back) / (lengths * lengths)
        gaps = [
            e + depths * direction - fractions * u for e, direction, u in zip(to_origin, directions, along, strict=True)
        ]
        reach = np.maximum(radius_m, min_reach * depths * lengths)
        first = (depths > NEAREST_M) & (_dot(gaps, gaps) <= reach * reach) & (depths - reach < self.depths[block])
        self._hit(block, first, depths - reach, rgb)

    def intersect_ball(self, center_m: Point, radius_m: float, rgb: Sequence[float]) -> None:
        """Hit a ball from outside. It is darker on its sides and below."""
        to_center = _subtract(center_m, self.origin_m)
        block = self.block_of([to_center], radius_m)
        if block is None:
            return
        lengths = self.lengths[block]
        slant = self.along(to_center, block) / lengths  # to the point of each ray that is next to the middle
        half2 = slant * slant + (radius_m * radius_m - _dot(to_center, to_center))  # of the chord, squared
        depths = (slant - np.sqrt(half2)) / lengths  # NaN for rays that miss it
        first = (depths > NEAREST_M) & (depths < self.depths[block])
        if not first.any():
            return
        up = (depths * self.directions[2][block] - to_center[2]) / radius_m  # of the unit vector outwards
        shades = 1.0 - STEEP_SHADE * (1.0 - np.maximum(0.0, up))
        self._hit(block, first, depths, shades[..., None] * np.array(rgb, dtype=float))

    def _hit(self, block: Any, where: Any, depths: Any, rgb: Any) -> None:
        np.copyto(self.depths[block], depths, where=where)
        np.copyto(self.colors[block], rgb, where=where[..., None])

    def through_water(self, backscatter_per_m: float = BACKSCATTER_PER_M) -> Image:
        """Return the light at the eye, shape (..., 3), through water with this scattering per metre."""
        is_hit = np.isfinite(self.depths)
        depths = np.where(is_hit, self.depths, 0.0)
        path_m = depths * self.lengths
        under_m = np.maximum(0.0, -(self.origin_m[2] + depths * self.directions[2]))
        clear = np.where(is_hit, attenuate(backscatter_per_m * path_m), 0.0)
        rgb = np.empty_like(self.colors)
        for i, attenuation in enumerate(ATTENUATION_PER_M):
            veil = VEIL_RGB[i] * attenuate(np.array(attenuation * max(0.0, -self.origin_m[2])))
            rgb[..., i] = self.colors[..., i] * attenuate(attenuation * (path_m + under_m)) * clear + veil * (
                1.0 - clear
            )
        image: Image = np.clip(np.floor(rgb + 0.5), 0.0, 255.0).astype(np.uint8)
        return image

    def through_air(self) -> Image:
        """Return the light at the eye, shape (..., 3): air neither absorbs nor veils it."""
        rgb = np.where(np.isfinite(self.depths)[..., None], self.colors, np.array(BACKGROUND_RGB))
        image: Image = np.clip(np.floor(rgb + 0.5), 0.0, 255.0).astype(np.uint8)
        return image


@np.errstate(divide="ignore", invalid="ignore")  # rays parallel to a face
def intersect_scene(rays: Rays, statics: dict[str, Any], balls: Sequence[Ball] = ()) -> None:
    """Intersect rays with the shapes of a scene, of the kinds in `prelude/plant.py`, and with balls that move."""
    for shape in statics.values():
        rgb = [float(value) for value in shape["rgb"]]
        if shape["kind"] == "polyline":
            points = shape["points_m"]
            for start, end in pairwise(points):
                rays.intersect_line(tuple(start), tuple(end), shape["radius_m"], rgb)
        elif shape["kind"] == "mesh":
            for i, j, k in shape["triangles"]:
                a, b, c = (tuple(shape["vertices_m"][corner]) for corner in (i, j, k))
                rays.intersect_triangle(a, b, c, rgb)
        else:
            (x, y, z), (dx, dy, dz) = shape["center_m"], shape["half_size_m"]
            corners = [(x + i * dx, y + j * dy, z + k * dz) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
            sides = zip(rays.origin_m, shape["center_m"], shape["half_size_m"], strict=True)
            faces_rays = [side * (at - middle) > half for at, middle, half in sides for side in (-1, 1)]
            for face, is_turned in zip(_BOX, faces_rays, strict=True):
                if not is_turned and any(faces_rays):
                    continue  # behind the others
                a, b, c, d = (corners[corner] for corner in face)
                rays.intersect_triangle(a, b, c, rgb)
                rays.intersect_triangle(a, c, d, rgb)
    for ball in balls:
        rays.intersect_ball(ball.center_m, ball.radius_m, ball.rgb)


def attenuate(thickness: Floats) -> Floats:
    """Return about exp(-thickness), 1 % too much at 4.5; rounded alike on every machine, as exp is not."""
    transmission = 1.0 / (1.0 + thickness / 1024.0)
    for _ in range(10):
        transmission = transmission * transmission
    return transmission


def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _subtract(a: Any, b: Any) -> Any:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Any, b: Any) -> Any:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
