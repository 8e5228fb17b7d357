"""Image of a plant's scene, one ray per pixel, in numpy alone.

MuJoCo's renderer needs OpenGL and a driver, which a Raspberry Pi or a server without a screen may lack, and each driver
rounds differently. This one uses only addition, multiplication, division and roots, which IEEE 754 rounds alike on
every machine; matrix products and `exp` are avoided, as their rounding differs. A shape is computed for those pixels
only that can show it.

It shows the static part of `scene()`, and balls that move. Water absorbs red first and green later, and veils what is
far.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from operator import itemgetter
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from snr_sim.devices.sensors.ray_marching import HeightField
from snr_sim.prelude.signals import Ball

Floats: TypeAlias = npt.NDArray[np.float64]
Image: TypeAlias = npt.NDArray[np.uint8]
Point: TypeAlias = tuple[float, float, float]
Triangle: TypeAlias = tuple[int, Sequence[Point], list[float]]  # number of its shape, corners, color
Line: TypeAlias = tuple[int, Sequence[Point], float, list[float]]  # number of its shape, ends, radius [m], color
Block: TypeAlias = tuple[slice, slice]  # rows and columns
# Number, block, color, and a function that returns depths and where they are the first, of what can be seen.
InView: TypeAlias = tuple[int, Block, list[float], Callable[[Block, Floats], tuple[Floats, Any] | None]]

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

    Shapes are hit in blocks of a grid of rows and columns, which is one row here, and the pixels of a camera's image.

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
        # The same in rows and columns: arrays that share their numbers.
        self._grid = self.grid_size()
        self._depths, self._colors = self.depths.reshape(self._grid), self.colors.reshape((*self._grid, 3))

    def grid_size(self) -> tuple[int, int]:
        """Return the number of rows and of columns."""
        return 1, self.lengths.size

    def blocks_of(self, corners: Floats, radii_m: Any = 0.0) -> Any:
        """Return the rays that can hit what is between some corners, for each of N shapes.

        Args:
            corners: relative to the origin: x, y and z, of the corners of each shape, shape (3, corners, N).
            radii_m: of a ball around each corner.

        Returns:
            First row, first column, first row behind, first column behind; integers of shape (4, N).
        """
        return np.repeat([[0], [0], [1], [self.lengths.size]], corners.shape[2], axis=1)  # all: they are in no order

    def along(self, vectors: Floats) -> tuple[Floats, Floats]:
        """Return the scalar products of vectors and directions, as a part by column and a part by row to be added.

        `vectors` has the shape (3, ...), and the parts have (..., columns) and (..., rows).
        """
        products = _dot(vectors[..., None], [one.reshape(-1) for one in self.directions])
        return products, np.zeros((*vectors.shape[1:], 1))

    def intersect_shapes(self, triangles: Sequence[Triangle], lines: Sequence[Line]) -> None:
        """Hit shapes; of those that are equally far, the one with the lowest number is seen."""
        in_view = [*self._triangles_in_view(triangles), *self._lines_in_view(lines)]
        in_view.sort(key=itemgetter(0))
        faces = np.full(self._grid, -1)
        for i, (_, block, _, hit) in enumerate(in_view):
            before = self._depths[block]
            found = hit(block, before)
            if found is not None:
                depths, first = found
                np.copyto(before, depths, where=first)
                np.copyto(faces[block], i, where=first)
        seen = faces >= 0
        if seen.any():
            self._colors[seen] = np.array([rgb for _, _, rgb, _ in in_view])[faces[seen]]

    def _triangles_in_view(self, triangles: Sequence[Triangle]) -> Iterator[InView]:
        """Yield the flat triangles that can be seen, from either side."""
        if not triangles:
            return
        starts = self._from_origin([corners for _, corners, _ in triangles])
        edges = starts[:, (1, 2, 0)] - starts
        normals = np.array(_cross(edges[:, 0], starts[:, 2] - starts[:, 0]))
        squares, blocks = _dot(normals, normals), self.blocks_of(starts)
        seen = np.flatnonzero((squares != 0.0) & (blocks[:2] < blocks[2:]).all(axis=0))
        starts, edges, normals, squares = starts[..., seen], edges[..., seen], normals[:, seen], squares[seen]
        inwards = np.array(_cross(normals[:, None], edges))
        # The edge is widened a little, so that no ray passes between two neighbours.
        limits = (_dot(starts, inwards) - 1e-9 * squares)[:, :, None, None]
        columns, rows = self.along(np.concatenate((normals[:, None], inwards), axis=1))
        columns, rows = columns[:, :, None, :], rows[:, :, :, None]
        tops, ups, squares = _dot(starts[:, 0], normals).tolist(), normals[2].tolist(), squares.tolist()
        for i, block in enumerate(_slices(blocks[:, seen])):
            number, _, rgb = triangles[seen[i]]
            level = abs(ups[i]) / squares[i] ** 0.5
            shaded = [value * (1.0 - STEEP_SHADE * (1.0 - level)) for value in rgb]
            yield number, block, shaded, partial(_hit_triangle, columns[:, i], rows[:, i], tops[i], limits[:, i])

    def _lines_in_view(self, lines: Sequence[Line]) -> Iterator[InView]:
        """Yield the round bars that can be seen. One thinner than a pixel is one pixel wide, or it would flicker."""
        if not lines:
            return
        ends = self._from_origin([points for _, points, _, _ in lines])
        # Half a pixel, and a little more: a bar just between two rows must show in at least one.
        min_reach = 0.505 * self.pixel
        reaches = np.maximum(
            [radius_m for _, _, radius_m, _ in lines], min_reach * np.sqrt(_dot(ends, ends)).max(axis=0)
        )
        blocks = self.blocks_of(ends, reaches)
        seen = np.flatnonzero((blocks[:2] < blocks[2:]).all(axis=0))
        for i, block in zip(seen.tolist(), _slices(blocks[:, seen]), strict=True):
            number, (a, b), radius_m, rgb = lines[i]
            yield number, block, rgb, partial(self._hit_line, a, b, radius_m, min_reach)

    def _from_origin(self, points: Sequence[Sequence[Point]]) -> Floats:
        """Return x, y and z of N shapes' corners relative to the origin, shape (3, corners, N)."""
        places: Floats = np.array(points, dtype=float).transpose(2, 1, 0) - np.array(self.origin_m)[:, None, None]
        return places

    def _hit_line(
        self, a: Point, b: Point, radius_m: float, min_reach: float, block: Block, before: Floats
    ) -> tuple[Floats, Any] | None:
        along, to_origin = _subtract(b, a), _subtract(self.origin_m, a)
        length2 = _dot(along, along)
        if length2 == 0.0:
            return None
        *directions, lengths = (one.reshape(self._grid)[block] for one in (*self.directions, self.lengths))
        slant, back = _dot(directions, along), _dot(directions, to_origin)
        squares = lengths * lengths
        spread = squares * length2 - slant * slant
        fractions = (squares * _dot(to_origin, along) - slant * back) / spread
        fractions = np.minimum(np.maximum(np.where(spread > 0.0, fractions, 0.0), 0.0), 1.0)
        depths = (fractions * slant - back) / squares
        gaps = [
            e + depths * direction - fractions * u for e, direction, u in zip(to_origin, directions, along, strict=True)
        ]
        reach = np.maximum(radius_m, min_reach * depths * lengths)
        hit = depths - reach
        return hit, (depths > NEAREST_M) & (_dot(gaps, gaps) <= reach * reach) & (hit < before)

    def intersect_height_field(self, shape: dict[str, Any]) -> None:
        """Hit ground that is a height for each place."""
        x, y, z = (one.reshape(-1) for one in self.directions)
        depths = self.depths.reshape(-1)
        found, levels = HeightField(shape).hits(self.origin_m, np.array((x, y, z)), depths)
        first = (found > NEAREST_M) & (found < depths)
        shades = 1.0 - STEEP_SHADE * (1.0 - levels[first])
        depths[first] = found[first]
        self.colors.reshape(-1, 3)[first] = shades[:, None] * np.array(shape["rgb"], dtype=float)

    def intersect_balls(self, balls: Sequence[Ball]) -> None:
        """Hit balls from outside, after the shapes. They are darker on their sides and below."""
        centers = np.array([ball.center_m for ball in balls], dtype=float).T - np.array(self.origin_m)[:, None]
        radii = np.array([ball.radius_m for ball in balls], dtype=float)
        row, column, end_row, end_column = self.blocks_of(centers[:, None], radii)
        # All pairs of a ball and a ray that can hit it: the ball, and the ray's row and column.
        wide = np.maximum(0, end_column - column)
        counts = np.maximum(0, end_row - row) * wide
        ball = np.repeat(np.arange(len(balls)), counts)
        down, right = np.divmod(np.arange(len(ball)) - np.repeat(np.cumsum(counts) - counts, counts), wide[ball])
        down, right = down + row[ball], right + column[ball]
        in_columns, in_rows = self.along(centers)
        ray = down * self._grid[1] + right
        lengths = self.lengths.reshape(-1)[ray]
        slant = (in_columns[ball, right] + in_rows[ball, down]) / lengths  # to a ray's point next to the middle
        half2 = slant * slant + (radii * radii - _dot(centers, centers))[ball]  # of the chord, squared
        depths = (slant - np.sqrt(half2)) / lengths  # NaN for rays that miss it
        first = np.flatnonzero((depths > NEAREST_M) & (depths < self.depths.reshape(-1)[ray]))
        # What is assigned last remains: the nearest, and of several equally near the first ball.
        first = first[::-1]
        first = first[np.argsort(-depths[first], kind="stable")]
        ball, ray, depths = ball[first], ray[first], depths[first]
        up = (depths * self.directions[2].reshape(-1)[ray] - centers[2][ball]) / radii[ball]  # of the unit normal
        shades = 1.0 - STEEP_SHADE * (1.0 - np.maximum(0.0, up))
        self._depths.reshape(-1)[ray] = depths
        self._colors.reshape(-1, 3)[ray] = shades[:, None] * np.array([one.rgb for one in balls], dtype=float)[ball]

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
    triangles: list[Triangle] = []
    lines: list[Line] = []
    fields: list[dict[str, Any]] = []
    for number, shape in enumerate(statics.values()):
        rgb = [float(value) for value in shape["rgb"]]
        if shape["kind"] == "polyline":
            lines += [(number, ends, shape["radius_m"], rgb) for ends in pairwise(shape["points_m"])]
        elif shape["kind"] == "mesh":
            vertices = shape["vertices_m"]
            triangles += [(number, (vertices[i], vertices[j], vertices[k]), rgb) for i, j, k in shape["triangles"]]
        elif shape["kind"] == "heightfield":
            fields.append(shape)
        else:
            (x, y, z), (dx, dy, dz) = shape["center_m"], shape["half_size_m"]
            corners = [(x + i * dx, y + j * dy, z + k * dz) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
            sides = zip(rays.origin_m, shape["center_m"], shape["half_size_m"], strict=True)
            faces_rays = [side * (at - middle) > half for at, middle, half in sides for side in (-1, 1)]
            for face, is_turned in zip(_BOX, faces_rays, strict=True):
                if not is_turned and any(faces_rays):
                    continue  # behind the others
                a, b, c, d = (corners[corner] for corner in face)
                triangles += [(number, (a, b, c), rgb), (number, (a, c, d), rgb)]
    rays.intersect_shapes(triangles, lines)
    for field in fields:
        rays.intersect_height_field(field)
    if balls:
        rays.intersect_balls(balls)


def _slices(blocks: Any) -> list[Block]:
    return [(slice(row, end), slice(column, right)) for row, column, end, right in blocks.T.tolist()]


def _hit_triangle(
    in_columns: Floats, in_rows: Floats, top: float, limits: Floats, block: Block, before: Floats
) -> tuple[Floats, Any] | None:
    in_columns, in_rows = in_columns[..., block[1]], in_rows[:, block[0]]
    depths = top / (in_columns[0] + in_rows[0])
    first = (depths > NEAREST_M) & (depths < before)
    if not first.any():
        return None
    first &= (depths * (in_columns[1:] + in_rows[1:]) >= limits).all(axis=0)
    return depths, first


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
