"""The ground under a lander: a line of heights along x, with a level or tilted pad around x = 0."""

from __future__ import annotations

import math
from dataclasses import dataclass

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.sums import ordered_sum

SPACING_M = 5.0  # between two points of the line; a foot pad is 0.9 m across, so the ground between is plain
HALF_WIDTH_M = 400.0
PAD_HALF_WIDTH_M = 15.0
ROOF_REACH_M = 10.0  # range of `roof_m` to either side: more than a leg's reach and the distance of a tenth second


@dataclass(frozen=True)
class Terrain:
    """Heights at evenly spaced positions.

    Args:
        heights_m: from x = -`HALF_WIDTH_M` to +`HALF_WIDTH_M`, `SPACING_M` apart; the middle one is 0.
        seed: of the hills that only the viewer shows.

    Raises:
        ParameterError: the number of heights is wrong, or one is not a number.
    """

    heights_m: tuple[float, ...]
    seed: int = 0

    def __post_init__(self) -> None:
        count = int(2 * HALF_WIDTH_M / SPACING_M) + 1
        if len(self.heights_m) != count:
            raise ParameterError(f"A terrain of {len(self.heights_m)} heights.", fix=f"{count}, {SPACING_M:g} m apart.")
        odd = next((height for height in self.heights_m if not math.isfinite(height)), None)
        if odd is not None:
            raise ParameterError(f"A terrain has the height {odd}.", fix="give finite numbers.")

    def ground(self, x_m: float) -> tuple[float, float]:
        """Return height [m] and slope [m/m] at a position; beyond the ends the last piece is extended."""
        heights = self.heights_m
        along = (x_m + HALF_WIDTH_M) / SPACING_M
        i = min(len(heights) - 2, max(0, int(along)))
        rise = heights[i + 1] - heights[i]
        return heights[i] + rise * (along - i), rise / SPACING_M

    def roof_m(self, x_m: float) -> float:
        """Return a height that nothing within `ROOF_REACH_M` exceeds."""
        i = min(len(self.heights_m) - 2, max(0, int((x_m + HALF_WIDTH_M) / SPACING_M)))
        reach = int(ROOF_REACH_M / SPACING_M)
        return max(self.heights_m[max(0, i - reach) : i + reach + 2])

    def points_m(self) -> list[tuple[float, float]]:
        """Return the line as (x, z)."""
        return [(i * SPACING_M - HALF_WIDTH_M, height) for i, height in enumerate(self.heights_m)]


FLAT = Terrain((0.0,) * (int(2 * HALF_WIDTH_M / SPACING_M) + 1))


def make_terrain(seed: int, relief_m: float, pad_slope_rad: float = 0.0) -> Terrain:
    """Return hills of about `relief_m` with a pad of one slope in their middle, another one for every seed."""
    rng = rng_for(seed, "terrain")
    waves = [(rng.uniform(0.7, 1.3) * length, rng.uniform(0.0, 2.0 * math.pi)) for length in (170.0, 95.0, 53.0, 31.0)]
    bumps: list[float] = rng.standard_normal(len(FLAT.heights_m)).tolist()
    tilt = math.tan(pad_slope_rad)

    def height(i: int, x: float) -> float:
        hills = ordered_sum(length / 170.0 * math.sin(2.0 * math.pi * x / length + phase) for length, phase in waves)
        on_pad = tilt * min(PAD_HALF_WIDTH_M, max(-PAD_HALF_WIDTH_M, x))
        # Hills rise within 60 m of the pad's edge, without a step at it.
        share = min(1.0, max(0.0, (abs(x) - PAD_HALF_WIDTH_M) / 60.0))
        return on_pad + relief_m * share * (0.5 * hills + 0.08 * bumps[i])

    return Terrain(tuple(height(i, x) for i, (x, _) in enumerate(FLAT.points_m())), seed)
