import math

import pytest

from snr_sim.plants.urov.surface import Surface
from tests.plants.vehicles import HEAVY

SURFACE = Surface(HEAVY)
LEVEL = (0.0, 0.0, 1.0)
LENGTH, WIDTH, HEIGHT = HEAVY.size_m
CENTRE = HEAVY.centre_of_buoyancy_m[2]


def test_submerged_fraction_of_level_box_is_linear() -> None:
    for share in (0.0, 0.1, 0.33, 0.5, 0.9, 1.0):
        z = (0.5 - share) * HEIGHT - CENTRE
        wet, middle = SURFACE.submerged_fraction(z, LEVEL)
        assert wet == pytest.approx(share, abs=1e-12)
        if share in (0.5, 1.0):  # whole layers of small boxes
            assert middle[2] == pytest.approx(CENTRE - 0.5 * (1.0 - share) * HEIGHT, abs=1e-12)


def test_submerged_fraction_far_from_surface_ignores_attitude() -> None:
    for up in (LEVEL, (0.0, 1.0, 0.0), (-0.6, 0.0, -0.8)):
        assert SURFACE.submerged_fraction(-SURFACE.reach_m, up) == (1.0, HEAVY.centre_of_buoyancy_m)
        assert SURFACE.submerged_fraction(SURFACE.reach_m, up)[0] == 0.0


def test_half_submerged_righting_moment_equals_waterplane() -> None:
    """The wet middle moves sideways by tilt * second moment of the waterplane / wet volume (Bouguer's metacentre)."""
    tilt = 1e-3
    wet, middle = SURFACE.submerged_fraction(-CENTRE, (0.0, math.sin(tilt), math.cos(tilt)))
    assert wet == pytest.approx(0.5, abs=1e-6)
    wet_volume = 0.5 * LENGTH * WIDTH * HEIGHT  # of the box that the displaced volume is spread over
    metacentre = LENGTH * WIDTH**3 / 12.0 / wet_volume
    assert -middle[1] / tilt == pytest.approx(metacentre, rel=0.07)  # 64 small boxes: their moments are 6 % short


def test_propeller_in_air_has_no_immersion() -> None:
    shares = SURFACE.propeller_immersion(0.0, LEVEL)
    assert shares.tolist() == pytest.approx([1.0] * 4 + [0.5] * 4)  # the level ones hang 8.5 cm lower
    assert SURFACE.propeller_immersion(0.2, LEVEL).tolist() == [0.0] * 8
    assert SURFACE.propeller_immersion(-0.2, LEVEL).tolist() == [1.0] * 8
