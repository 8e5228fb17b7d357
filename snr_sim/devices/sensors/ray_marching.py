"""Where rays meet ground that is a height for each place: a field of heights, as in `Plant.scene`.

A ray goes over the field in strides of one square. In the stride in which it gets under the ground it is halved until
the place is known to a millionth of it. Between four neighbours a height is bilinear. A ray that dips under a crest and
comes out again within one stride misses it. As in `ray_casting.py`, all arithmetic rounds alike on every machine.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
HALVINGS = 20


class HeightField:
    """A field of heights, for rays.

    Args:
        shape: of the kind "heightfield".
    """

    def __init__(self, shape: dict[str, Any]) -> None:
        self._heights_m: Floats = np.array(shape["heights_m"], dtype=float).reshape(shape["shape"])
        self._corner_m, self._spacing_m = shape["corner_m"], shape["spacing_m"]
        rows, columns = self._heights_m.shape
        self._squares = columns - 1, rows - 1

    def hits(self, origin_m: tuple[float, float, float], directions: Floats, before: Floats) -> tuple[Floats, Floats]:
        """Return how far along each ray the ground is, infinity where there is none, and how level it is there.

        Args:
            origin_m: of all rays.
            directions: x, y and z of each, shape (3, rays).
            before: nothing farther than this is looked for, shape (rays,).
        """
        found, levels = np.full(before.shape, np.inf), np.zeros(before.shape)
        # In squares of the field: u to the east, v to the north.
        (west, south), (wide, high) = self._corner_m, self._spacing_m
        starts = (origin_m[0] - west) / wide, (origin_m[1] - south) / high, origin_m[2]
        ways = directions[0] / wide, directions[1] / high, directions[2]
        first, last = np.zeros(before.shape), before.copy()
        low_m, high_m = float(self._heights_m.min()) - 1e-3, float(self._heights_m.max()) + 1e-3
        bounds = (0.0, float(self._squares[0])), (0.0, float(self._squares[1])), (low_m, high_m)
        for start, way, (lowest, highest) in zip(starts, ways, bounds, strict=True):
            one, other = (lowest - start) / way, (highest - start) / way
            is_inside = lowest <= start <= highest  # where the ray does not move along this axis
            nearest = np.where(way == 0.0, -np.inf if is_inside else np.inf, np.minimum(one, other))
            farthest = np.where(way == 0.0, np.inf, np.maximum(one, other))
            first, last = np.maximum(first, nearest), np.minimum(last, farthest)
        rays = np.flatnonzero((first < last) & np.isfinite(last))
        u, v, w = (way[rays] for way in ways)
        near, end = first[rays], last[rays]
        stride = np.minimum(end - near, 1.0 / np.maximum(np.maximum(np.abs(u), np.abs(v)), 1e-12))
        was_under = self._above_m(starts, (u, v, w), near) < 0.0
        while rays.size:
            far = np.minimum(near + stride, end)
            is_hit = (self._above_m(starts, (u, v, w), far) < 0.0) != was_under
            if is_hit.any():
                hit, path = rays[is_hit], (u[is_hit], v[is_hit], w[is_hit])
                low, up, under = near[is_hit], far[is_hit], was_under[is_hit]
                for _ in range(HALVINGS):
                    middle = 0.5 * (low + up)
                    is_past = (self._above_m(starts, path, middle) < 0.0) != under
                    low, up = np.where(is_past, low, middle), np.where(is_past, middle, up)
                found[hit], levels[hit] = up, self._level(starts, path, up)
            goes_on = ~is_hit & (far < end)
            rays, u, v, w = rays[goes_on], u[goes_on], v[goes_on], w[goes_on]
            near, end, stride, was_under = far[goes_on], end[goes_on], stride[goes_on], was_under[goes_on]
        return found, levels

    def _square(self, starts: Any, ways: Any, depths: Floats) -> tuple[Floats, Floats, tuple[Floats, ...]]:
        """Return where in its square each ray is, 0 to 1 to the east and to the north, and the corners' heights [m]."""
        u, v = starts[0] + depths * ways[0], starts[1] + depths * ways[1]
        i, j = (
            np.minimum(np.maximum(at, 0.0), count - 1).astype(int)
            for at, count in zip((u, v), self._squares, strict=True)
        )
        heights_m = self._heights_m
        return u - i, v - j, (heights_m[j, i], heights_m[j, i + 1], heights_m[j + 1, i], heights_m[j + 1, i + 1])

    def _above_m(self, starts: Any, ways: Any, depths: Floats) -> Floats:
        s, t, (a, b, c, d) = self._square(starts, ways, depths)
        south, north = a + s * (b - a), c + s * (d - c)
        above_m: Floats = starts[2] + depths * ways[2] - (south + t * (north - south))
        return above_m

    def _level(self, starts: Any, ways: Any, depths: Floats) -> Floats:
        """Return the vertical part of the unit normal."""
        s, t, (a, b, c, d) = self._square(starts, ways, depths)
        to_east = ((b - a) + t * ((d - c) - (b - a))) / self._spacing_m[0]
        to_north = ((c - a) + s * ((d - b) - (c - a))) / self._spacing_m[1]
        level: Floats = 1.0 / np.sqrt(1.0 + to_east * to_east + to_north * to_north)
        return level
