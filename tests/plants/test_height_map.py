"""Smooth ground: height, slope, the nearest plane, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.plants.ground.height_map import LEVEL, HeightMap, flat, make_hills, ramp
from snr_sim.prelude.errors import ParameterError

HILLS = make_hills(3, relief_m=0.5)
places = st.floats(-25.0, 25.0)


def basis(t: float, degree: int) -> float:
    """Value of the uniform B-spline over [0, degree + 1], by the recursion of Cox and de Boor."""
    if degree == 0:
        return 1.0 if 0.0 <= t < 1.0 else 0.0
    return (t * basis(t, degree - 1) + (degree + 1 - t) * basis(t - 1.0, degree - 1)) / degree


def slope_of_basis(t: float, degree: int) -> float:
    return basis(t, degree - 1) - basis(t - 1.0, degree - 1)


def test_height_and_slope_equal_the_recursion_of_cox_and_de_boor() -> None:
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(9, 11))
    ground = HeightMap(rows.tolist(), 0.5, (-1.0, 2.0))
    for x, y in rng.uniform((-0.7, 2.3), (3.7, 5.7), size=(50, 2)).tolist():
        u, v = (x + 1.0) / 0.5 + 1.5, (y - 2.0) / 0.5 + 1.5
        along_x, along_y = (
            np.array([[f(at - k, 2) for k in range(count)] for f in (basis, slope_of_basis)])
            for at, count in ((u, rows.shape[1]), (v, rows.shape[0]))
        )
        height, slope_x, slope_y = (
            along_y[i] @ rows @ along_x[j] / 0.5 ** (i + j) for i, j in ((0, 0), (0, 1), (1, 0))
        )
        np.testing.assert_allclose(ground.at(x, y), (height, slope_x, slope_y), atol=1e-12)


@given(x=places, y=places)
def test_slope_is_that_of_the_height_everywhere(x: float, y: float) -> None:
    e = 1e-5
    _, slope_x, slope_y = HILLS.at(x, y)
    assert slope_x == pytest.approx((HILLS.at(x + e, y)[0] - HILLS.at(x - e, y)[0]) / (2.0 * e), abs=1e-4)
    assert slope_y == pytest.approx((HILLS.at(x, y + e)[0] - HILLS.at(x, y - e)[0]) / (2.0 * e), abs=1e-4)


@given(x=places, y=places)
def test_plane_under_a_wheel_is_perpendicular_to_the_way_to_it(x: float, y: float) -> None:
    z = HILLS.at(x, y)[0] + 0.13
    plane = LEVEL
    for _ in range(20):
        (plane,) = HILLS.planes_under([(x, y, z)], [plane])
    px, py, pz, *normal = plane
    assert pz == HILLS.at(px, py)[0]
    assert math.dist(normal, (0.0, 0.0, 0.0)) == pytest.approx(1.0)
    across = np.cross((x - px, y - py, z - pz), normal)
    assert np.abs(across).max() < 1e-9


def test_ground_is_level_beyond_its_edge() -> None:
    ground = ramp((0.1, 0.0), 20.0)
    edge_m = ground.at(1e3, 0.0)[0]
    assert ground.at(2e3, 0.0) == (edge_m, 0.0, 0.0)
    assert edge_m == pytest.approx(0.1 * 12.5, abs=0.3)


def test_same_seed_gives_same_hills_with_a_level_start() -> None:
    again = make_hills(3, relief_m=0.5)
    assert np.array_equal(HILLS.control_values(), again.control_values())
    assert not np.array_equal(HILLS.control_values(), make_hills(4, relief_m=0.5).control_values())
    assert max(map(abs, HILLS.at(0.0, 0.0))) < 0.02
    assert HILLS.control_values().std() == pytest.approx(0.5, rel=0.3)


def test_wheel_that_touches_a_hollow_twice_is_refused() -> None:
    rough = make_hills(1, relief_m=1.0, length_m=1.0, spacing_m=0.1)
    with pytest.raises(ParameterError, match=r"hollow with a radius of 0\.0\d+ m, and wheel LF a radius of 0\.13 m"):
        rough.check_rolls(0.13, "wheel LF")
    flat().check_rolls(1.0, "a wheel")
    assert flat().min_radius_m() == math.inf


@pytest.mark.parametrize(
    ("rows", "spacing_m", "message"),
    [
        ([[0.0] * 3] * 2, 1.0, "has 2 rows of 3 values"),
        ([], 1.0, "has 0 rows of no values"),
        ([[0.0] * 3, [0.0] * 4, [0.0] * 3], 1.0, "has 3 rows of 3, 4 values"),
        ([[0.0, 0.0, math.nan]] * 3, 1.0, "height in row 0, column 2 is nan"),
        ([[0.0] * 3] * 3, 500.0, "spacing_m is 500.0: millimetres"),
        ([[0.0] * 3] * 3, 0.0, "spacing_m is 0"),
    ],
)
def test_invalid_ground_is_refused_with_the_reason(rows: list[list[float]], spacing_m: float, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        HeightMap(rows, spacing_m)
