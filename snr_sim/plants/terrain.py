"""The ground under a lander: a line of heights along x with a level or tilted pad around x = 0.

The line is what the physics stands on. For the viewer it gets depth: rows of the same line to either side, with
hills of their own that grow with the distance from it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from snr_sim.prelude.rng import rng_for

SPACING_M = 5.0  # between two points of the line; a foot pad is 0.9 m across, so the ground between is plain
HALF_WIDTH_M = 400.0
PAD_HALF_WIDTH_M = 15.0
ROOF_REACH_M = 10.0  # how far to either side `roof_m` looks: more than a leg's reach and the way of a tenth second

GROUND_RGB = [112, 110, 107]
LINE_RGB = [158, 155, 150]
PAD_RGB = [201, 178, 96]
ROWS_M = (-60.0, -38.0, -22.0, -11.0, -4.0, 4.0, 11.0, 22.0, 38.0, 60.0)  # where the ribbon has points in y


@dataclass(frozen=True)
class Terrain:
    """Heights at evenly spaced places.

    Args:
        heights_m: from x = -`HALF_WIDTH_M` to +`HALF_WIDTH_M`, `SPACING_M` apart; the middle one is 0.
        seed: of the hills that only the viewer sees.
    """

    heights_m: tuple[float, ...]
    seed: int = 0

    def ground(self, x_m: float) -> tuple[float, float]:
        """Returns height [m] and slope [m/m] at a place; beyond the ends the last piece goes on."""
        heights = self.heights_m
        along = (x_m + HALF_WIDTH_M) / SPACING_M
        i = min(len(heights) - 2, max(0, int(along)))
        rise = heights[i + 1] - heights[i]
        return heights[i] + rise * (along - i), rise / SPACING_M

    def roof_m(self, x_m: float) -> float:
        """Returns a height that nothing within `ROOF_REACH_M` exceeds."""
        i = min(len(self.heights_m) - 2, max(0, int((x_m + HALF_WIDTH_M) / SPACING_M)))
        reach = int(ROOF_REACH_M / SPACING_M)
        return max(self.heights_m[max(0, i - reach) : i + reach + 2])

    def points_m(self) -> list[tuple[float, float]]:
        """Returns the line as (x, z)."""
        return [(i * SPACING_M - HALF_WIDTH_M, height) for i, height in enumerate(self.heights_m)]


FLAT = Terrain((0.0,) * (int(2 * HALF_WIDTH_M / SPACING_M) + 1))


def make_terrain(seed: int, relief_m: float, pad_slope_rad: float = 0.0) -> Terrain:
    """Returns hills of about `relief_m` with a pad of one slope in their middle, another one for every seed."""
    rng = rng_for(seed, "terrain")
    waves = [(rng.uniform(0.7, 1.3) * length, rng.uniform(0.0, 2.0 * math.pi)) for length in (170.0, 95.0, 53.0, 31.0)]
    bumps: list[float] = rng.standard_normal(len(FLAT.heights_m)).tolist()
    tilt = math.tan(pad_slope_rad)

    def height(i: int, x: float) -> float:
        hills = sum(length / 170.0 * math.sin(2.0 * math.pi * x / length + phase) for length, phase in waves)
        on_pad = tilt * min(PAD_HALF_WIDTH_M, max(-PAD_HALF_WIDTH_M, x))
        # Hills rise within 60 m of the pad's edge, without a step at it.
        share = min(1.0, max(0.0, (abs(x) - PAD_HALF_WIDTH_M) / 60.0))
        return on_pad + relief_m * share * (0.5 * hills + 0.08 * bumps[i])

    return Terrain(tuple(height(i, x) for i, (x, _) in enumerate(FLAT.points_m())), seed)


def terrain_shapes(terrain: Terrain) -> dict[str, Any]:
    """Returns ground, pad and lines for the viewer, by name."""
    line = terrain.points_m()
    first, last = (int((HALF_WIDTH_M + side * PAD_HALF_WIDTH_M) / SPACING_M) for side in (-1, 1))
    rows = [_row(terrain, line, y) for y in ROWS_M]
    pad = [[[x, y, z + 0.04] for x, z in line[first : last + 1]] for y in (-PAD_HALF_WIDTH_M, PAD_HALF_WIDTH_M)]
    border = [*pad[0], *reversed(pad[1]), pad[0][0]]
    shapes: dict[str, Any] = {
        "ground": _ribbon(rows, GROUND_RGB),
        "pad": _ribbon(pad, PAD_RGB),
        "pad_border": {"kind": "polyline", "points_m": border, "rgb": [240, 232, 200], "radius_m": 0.12},
        "profile": _polyline([[x, 0.0, z + 0.05] for x, z in line], [225, 222, 215], 0.08),
    }
    for y, row in zip(ROWS_M, rows, strict=True):
        shapes[f"line_{y:+.0f}"] = _polyline([[x, y_, z + 0.03] for x, y_, z in row], LINE_RGB, 0.04)
    return shapes


def _row(terrain: Terrain, line: Sequence[tuple[float, float]], y: float) -> list[list[float]]:
    """Returns the line at depth y. Near y = 0 it is the true ground, so that feet stand on what they touch."""
    rng = rng_for(terrain.seed, f"terrain row {y:+.0f}")
    share = min(1.0, max(0.0, (abs(y) - 5.0) / 50.0)) * (1.0 if terrain is not FLAT else 0.4)
    lengths = [rng.uniform(25.0, 90.0) for _ in range(3)]
    phases = [rng.uniform(0.0, 2.0 * math.pi) for _ in range(3)]

    def hill(x: float) -> float:
        off_pad = min(1.0, abs(x) / PAD_HALF_WIDTH_M / 2.0) if abs(y) < 2.0 * PAD_HALF_WIDTH_M else 1.0
        return off_pad * share * sum(math.sin(x / w * 2.0 * math.pi + p) for w, p in zip(lengths, phases, strict=True))

    return [[x, y, round(z + 1.3 * hill(x), 3)] for x, z in line]


def _polyline(points: list[list[float]], rgb: list[int], radius_m: float) -> dict[str, Any]:
    return {"kind": "polyline", "points_m": points, "rgb": rgb, "radius_m": radius_m}


def _ribbon(rows: list[list[list[float]]], rgb: list[int]) -> dict[str, Any]:
    """Returns a mesh through rows of equally many points, facing up."""
    n = len(rows[0])
    triangles = []
    for r in range(len(rows) - 1):
        for i in range(n - 1):
            a, b = r * n + i, (r + 1) * n + i
            triangles += [[a, a + 1, b], [a + 1, b + 1, b]]
    return {"kind": "mesh", "vertices_m": [point for row in rows for point in row], "triangles": triangles, "rgb": rgb}
