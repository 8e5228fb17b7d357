"""Latitude and longitude as meters on a plane, against published figures of the ellipsoid."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.prelude.geodesy import TangentPlane, earth_fixed


# Lengths of a degree of latitude and longitude on WGS-84: National Geospatial-Intelligence Agency, "Length of a degree
# of latitude and longitude" (calculator), in meters.
@pytest.mark.parametrize(
    ("latitude_deg", "north_m", "east_m"),
    [(0.0, 110574.3, 111319.5), (45.0, 111131.7, 78846.8), (60.0, 111412.2, 55800.0)],
)
def test_small_angles_are_as_long_as_published_degrees(latitude_deg: float, north_m: float, east_m: float) -> None:
    plane = TangentPlane(latitude_deg, 8.0)
    assert plane.local(latitude_deg + 1e-4, 8.0)[1] == pytest.approx(1e-4 * north_m, rel=1e-5)
    assert plane.local(latitude_deg, 8.0 + 1e-4)[0] == pytest.approx(1e-4 * east_m, rel=1e-5)


def test_earth_fixed_axes_end_at_published_radii() -> None:
    assert earth_fixed(0.0, 90.0, 100.0) == pytest.approx((0.0, 6378237.0, 0.0), abs=1e-6)
    assert earth_fixed(90.0, 0.0, 0.0) == pytest.approx((0.0, 0.0, 6356752.314245), abs=1e-6)


def test_plane_stays_level_while_the_ground_falls_away() -> None:
    # At a distance d the ellipsoid is d^2 / 2R below the plane; R is between its radii of curvature.
    plane = TangentPlane(38.4, -110.8)
    latitude_deg, longitude_deg, altitude_m = plane.geodetic(0.0, 1000.0)
    assert altitude_m == pytest.approx(1000.0**2 / (2.0 * 6.36e6), rel=0.01)
    assert plane.local(latitude_deg, longitude_deg)[2] == pytest.approx(-altitude_m, rel=0.01)


@given(
    st.floats(-80.0, 80.0), st.floats(-180.0, 180.0), st.floats(-1000.0, 1000.0), st.floats(-1000.0, 1000.0),
    st.floats(-100.0, 100.0),
)  # fmt: skip
def test_way_to_degrees_and_back_ends_where_it_began(
    latitude_deg: float, longitude_deg: float, east_m: float, north_m: float, up_m: float
) -> None:
    plane = TangentPlane(latitude_deg, longitude_deg)
    back = plane.local(*plane.geodetic(east_m, north_m, up_m))
    assert math.dist(back, (east_m, north_m, up_m)) < 1e-5
