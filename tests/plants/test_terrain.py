import math

import pytest

from snr_sim.plants.lander.terrain import FLAT, HALF_WIDTH_M, PAD_HALF_WIDTH_M, ROOF_REACH_M, make_terrain


@pytest.mark.parametrize("seed", range(20))
def test_pad_is_plane_with_centre_at_zero(seed: int) -> None:
    tilt = 0.05 * (-1) ** seed
    terrain = make_terrain(seed, relief_m=14.0, pad_slope_rad=tilt)
    for x in (-PAD_HALF_WIDTH_M + 0.1, -3.0, 0.0, 7.0, PAD_HALF_WIDTH_M - 0.1):
        assert terrain.ground(x) == pytest.approx((math.tan(tilt) * x, math.tan(tilt)), abs=1e-9)


def test_terrain_is_reproducible_per_seed() -> None:
    assert make_terrain(4, 5.0) == make_terrain(4, 5.0)
    assert make_terrain(4, 5.0).heights_m != make_terrain(5, 5.0).heights_m


def test_relief_scales_hills() -> None:
    def span(relief_m: float) -> float:
        return max(max(t.heights_m) - min(t.heights_m) for t in (make_terrain(seed, relief_m) for seed in range(10)))

    assert span(5.0) < 20.0
    assert span(14.0) > 1.5 * span(5.0)


@pytest.mark.parametrize("x", [-2000.0, -HALF_WIDTH_M, -399.0, -31.0, 0.0, 12.3, 399.0, HALF_WIDTH_M, 2000.0])
def test_roof_is_above_ground_within_reach(x: float) -> None:
    terrain = make_terrain(7, 14.0)
    inside = [x + dx for dx in (-ROOF_REACH_M, -3.0, 0.0, 4.0, ROOF_REACH_M) if abs(x + dx) <= HALF_WIDTH_M]
    assert all(terrain.ground(place)[0] <= terrain.roof_m(x) + 1e-9 for place in inside)


def test_flat_terrain_is_flat() -> None:
    assert FLAT.ground(123.4) == (0.0, 0.0)
