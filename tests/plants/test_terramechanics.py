"""Soil under wheels: the equations of Wong's book, solved in another way, and their limits."""

import math
from itertools import pairwise

import pytest

from snr_sim.plants.ground.terramechanics import DRY_SAND, LUNAR_SOIL, Bekker, Coulomb, slip_of
from snr_sim.prelude.errors import ParameterError

LOAD_N, RADIUS_M, WIDTH_M = 70.0, 0.13, 0.1
both = pytest.mark.parametrize("soil", [DRY_SAND, LUNAR_SOIL], ids=["dry sand", "lunar"])


@both
def test_pressure_of_the_sunken_wheel_carries_its_load(soil: Bekker) -> None:
    """Integrates the pressure along the rim, with the parabola that Wong puts in the circle's place."""
    sinkage_m = soil.sinkage_m(LOAD_N, RADIUS_M, WIDTH_M)
    steps, carried_n = 200_000, 0.0
    # With t = sqrt(sinkage - depth) the way along the ground is sqrt(diameter) t, and the load the integral of p dx.
    for i in range(steps):
        t = math.sqrt(sinkage_m) * (i + 0.5) / steps
        depth_m = sinkage_m - t * t
        pressure = (soil.kc / WIDTH_M + soil.kphi) * depth_m**soil.n
        carried_n += WIDTH_M * pressure * math.sqrt(2.0 * RADIUS_M) * math.sqrt(sinkage_m) / steps
    # Wong expands (1 - t^2)^n to its first terms, which makes (3 - n) / 3 of the integral.
    assert carried_n == pytest.approx(LOAD_N, rel=0.03)


@both
def test_resistance_is_the_work_of_pressing_the_rut(soil: Bekker) -> None:
    sinkage_m = soil.sinkage_m(LOAD_N, RADIUS_M, WIDTH_M)
    steps = 100_000
    depths = ((i + 0.5) * sinkage_m / steps for i in range(steps))
    work = sum(WIDTH_M * (soil.kc / WIDTH_M + soil.kphi) * depth**soil.n for depth in depths) * sinkage_m / steps
    assert soil.forces_at(0.0, LOAD_N, RADIUS_M, WIDTH_M)[1] == pytest.approx(work, rel=1e-6)


@both
def test_traction_is_the_mean_shear_stress_along_the_contact(soil: Bekker) -> None:
    slip, length_m = 0.3, math.sqrt(2.0 * RADIUS_M * soil.sinkage_m(LOAD_N, RADIUS_M, WIDTH_M))
    steps = 100_000
    sheared = ((i + 0.5) / steps * length_m * slip for i in range(steps))
    share = sum(1.0 - math.exp(-one / soil.shear_m) for one in sheared) / steps
    strength_n = WIDTH_M * length_m * soil.cohesion_pa + LOAD_N * math.tan(soil.phi_rad)
    assert soil.forces_at(slip, LOAD_N, RADIUS_M, WIDTH_M)[0] * LOAD_N == pytest.approx(share * strength_n, rel=1e-6)


@both
def test_traction_grows_with_slip_from_zero(soil: Bekker) -> None:
    found = [soil.forces_at(0.01 * i, LOAD_N, RADIUS_M, WIDTH_M)[0] for i in range(101)]
    assert found[0] == 0.0
    assert all(a < b for a, b in pairwise(found))
    tiny = [soil.forces_at(slip, LOAD_N, RADIUS_M, WIDTH_M)[0] / slip for slip in (1e-7, 1e-5, 1e-3)]
    assert tiny == pytest.approx([tiny[0]] * 3, rel=1e-2), "series and formula agree where they meet"


def test_wheel_without_load_feels_nothing() -> None:
    for soil in (DRY_SAND, Coulomb(0.8)):
        assert soil.sinkage_m(0.0, RADIUS_M, WIDTH_M) == soil.forces_at(0.0, 0.0, RADIUS_M, WIDTH_M)[1] == 0.0
    assert DRY_SAND.forces_at(0.5, 0.0, RADIUS_M, WIDTH_M)[0] == 0.0
    assert Coulomb(0.5).forces_at(0.0, LOAD_N, RADIUS_M, WIDTH_M)[0] == 0.5


@pytest.mark.parametrize(
    ("rolling_mps", "forward_mps", "sideways_mps", "slip"),
    [
        (1.0, 1.0, 0.0, 0.0),
        (1.0, 0.5, 0.0, 0.5),
        (0.5, 1.0, 0.0, 0.5),
        (1.0, 0.0, 0.0, 1.0),
        (0.0, 1.0, 0.0, 1.0),
        (-1.0, 1.0, 0.0, 1.0),
        (0.0, 0.0, 1.0, 1.0),
        (0.0, 0.0, 0.0, 0.0),
    ],
)
def test_slip_is_what_a_wheel_lacks_of_rolling(
    rolling_mps: float, forward_mps: float, sideways_mps: float, slip: float
) -> None:
    assert slip_of(rolling_mps, forward_mps, sideways_mps) == pytest.approx(slip, abs=2e-3)


def test_soil_in_wrong_units_is_refused_with_a_guess() -> None:
    with pytest.raises(ParameterError, match=r"phi_rad is 28: degrees\?"):
        Bekker(1.1, 990.0, 1_528_430.0, 1040.0, 28, 0.025)
    with pytest.raises(ParameterError, match=r"kphi is 0"):
        Bekker(1.1, 990.0, 0.0, 1040.0, 0.49, 0.025)
