"""Shapes of the ground: the line that the physics uses, with terrain to either side, for the viewer alone.

Close to the line the terrain is the line itself, so that feet stand on what they touch. Farther out it goes its own
way, with hills in all directions and craters, the same for the same ground.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.lander.terrain import PAD_HALF_WIDTH_M, SPACING_M, Terrain
from snr_sim.plants.shapes import mesh, polyline
from snr_sim.prelude.rng import rng_for

SHOWN_M = 250.0  # to either side of the pad; no flight that ends well goes farther
_ROWS_M = (7.0, 15.0, 21.0, 28.0, 36.0, 46.0, 58.0, 72.0, 90.0)
ROWS_M = (*(-y for y in reversed(_ROWS_M)), *_ROWS_M)  # to both sides of the line
OWN_FROM_M, OWN_TO_M = 13.0, 50.0  # between these distances from the line the country becomes its own
CRATERS = 36
PAD_HALF_DEPTH_M = 13.0

GROUND_RGB = [128, 125, 120]
PAD_RGB = [196, 168, 84]
BORDER_RGB = [244, 238, 214]

Heights: TypeAlias = NDArray[np.float64]


@lru_cache(maxsize=4)  # a hundred runs over flat ground need it drawn once
def terrain_shapes(terrain: Terrain) -> dict[str, Any]:
    """Return ground, pad and line for the viewer, by name. Not to be changed: the next run over it gets the same."""
    places = [i * SPACING_M - SHOWN_M for i in range(int(2 * SHOWN_M / SPACING_M) + 1)]
    heights = [terrain.ground(x)[0] for x in places]
    x, y = np.meshgrid(places, ROWS_M)
    country = _country(terrain, x, y, np.broadcast_to(heights, x.shape)).round(2)
    rows = np.stack([x, y, country], axis=-1).tolist()
    ends = (-PAD_HALF_WIDTH_M, PAD_HALF_WIDTH_M)
    pad = [[[x, y, terrain.ground(x)[0] + 0.06] for x in ends] for y in (-PAD_HALF_DEPTH_M, PAD_HALF_DEPTH_M)]
    line = [[place, 0.0, round(height + 0.08, 3)] for place, height in zip(places, heights, strict=True)]
    return {
        "ground": _ribbon(rows, GROUND_RGB),
        "pad": _ribbon(pad, PAD_RGB),
        "pad_border": polyline([*pad[0], *reversed(pad[1]), pad[0][0]], BORDER_RGB, 0.15),
        "line": polyline(line, BORDER_RGB, 0.06),
        "near_edge": polyline(rows[0], BORDER_RGB, 0.12),
        "far_edge": polyline(rows[-1], BORDER_RGB, 0.12),
    }


def _country(terrain: Terrain, x: Heights, y: Heights, line: Heights) -> Heights:
    """Return the heights of the shown ground at a grid of points, all of shape (rows, points)."""
    rng = rng_for(terrain.seed, "country")
    own = np.clip((np.abs(y) - OWN_FROM_M) / (OWN_TO_M - OWN_FROM_M), 0.0, 1.0)
    hills = np.zeros_like(x)
    for length in (120.0, 75.0, 44.0, 27.0):
        turn, phase = rng.uniform(0.0, math.pi), rng.uniform(0.0, 2.0 * math.pi)
        across = x * math.cos(turn) + y * math.sin(turn)
        hills += length / 45.0 * np.sin(2.0 * math.pi / length * across + phase)  # decides no run: shown, to the cm
    heights: Heights = line * (1.0 - 0.7 * own) + own * hills
    for _ in range(CRATERS):
        radius = 5.0 + 14.0 * rng.uniform() ** 2
        # A bowl with a rim, which keeps off the strip where the module may stand.
        from_line = (PAD_HALF_DEPTH_M + 1.5 * radius + rng.uniform(0.0, 50.0)) * rng.choice((-1.0, 1.0))
        away = np.hypot(x - rng.uniform(-SHOWN_M, SHOWN_M), y - from_line) / radius  # decides no run: shown
        bowl = np.minimum(0.0, away**2 - 1.0) + 0.3 * np.maximum(0.0, 1.0 - 2.0 * np.abs(away - 1.0))
        heights += 0.22 * radius * bowl
    return heights


def _ribbon(rows: list[list[list[float]]], rgb: list[int]) -> dict[str, Any]:
    """Return a mesh through rows of equally many points, facing up."""
    n = len(rows[0])
    triangles = []
    for r in range(len(rows) - 1):
        for i in range(n - 1):
            a, b = r * n + i, (r + 1) * n + i
            triangles += [[a, a + 1, b], [a + 1, b + 1, b]]
    return mesh([point for row in rows for point in row], triangles, rgb)
