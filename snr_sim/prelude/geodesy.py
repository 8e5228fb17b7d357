"""Latitude and longitude as meters on a plane that touches the Earth, and back. Ellipsoid WGS-84.

Source: Hofmann-Wellenhof, Lichtenegger, Wasle, GNSS (Springer 2008), chapters 8 and 10; its inverse is Bowring's, which
is off by less than a micrometer near the ground.
"""

from __future__ import annotations

import math

SEMI_MAJOR_M = 6378137.0
FLATTENING = 1.0 / 298.257223563
SEMI_MINOR_M = SEMI_MAJOR_M * (1.0 - FLATTENING)
E2 = FLATTENING * (2.0 - FLATTENING)  # first eccentricity, squared
SECOND_E2 = E2 / (1.0 - E2)


class TangentPlane:
    """The plane that touches the ellipsoid at a point: x to the east, y to the north, z up.

    >>> east_m, north_m, _ = TangentPlane(50.0, 8.0).local(50.001, 8.0)
    >>> round(east_m, 3), round(north_m, 3)
    (-0.0, 111.229)
    """

    def __init__(self, latitude_deg: float, longitude_deg: float) -> None:
        latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
        self._sin, self._cos = math.sin(latitude), math.cos(latitude)
        self._sin_east, self._cos_east = math.sin(longitude), math.cos(longitude)
        self._origin = earth_fixed(latitude_deg, longitude_deg, 0.0)

    def local(self, latitude_deg: float, longitude_deg: float, altitude_m: float = 0.0) -> tuple[float, float, float]:
        """Return east, north and up of a point [m]; its altitude is over the ellipsoid."""
        dx, dy, dz = (
            a - b for a, b in zip(earth_fixed(latitude_deg, longitude_deg, altitude_m), self._origin, strict=True)
        )
        outwards = self._cos_east * dx + self._sin_east * dy
        east = self._cos_east * dy - self._sin_east * dx
        return east, self._cos * dz - self._sin * outwards, self._cos * outwards + self._sin * dz

    def geodetic(self, east_m: float, north_m: float, up_m: float = 0.0) -> tuple[float, float, float]:
        """Return latitude and longitude [degrees] of a point near the ground, and its altitude [m]."""
        outwards = self._cos * up_m - self._sin * north_m
        x = self._origin[0] + self._cos_east * outwards - self._sin_east * east_m
        y = self._origin[1] + self._sin_east * outwards + self._cos_east * east_m
        z = self._origin[2] + self._cos * north_m + self._sin * up_m
        from_axis = math.hypot(x, y)
        reduced = math.atan2(z * SEMI_MAJOR_M, from_axis * SEMI_MINOR_M)
        latitude = math.atan2(
            z + SECOND_E2 * SEMI_MINOR_M * math.sin(reduced) ** 3,
            from_axis - E2 * SEMI_MAJOR_M * math.cos(reduced) ** 3,
        )
        sin = math.sin(latitude)
        altitude_m = from_axis * math.cos(latitude) + z * sin - SEMI_MAJOR_M * math.sqrt(1.0 - E2 * sin * sin)
        return math.degrees(latitude), math.degrees(math.atan2(y, x)), altitude_m


def earth_fixed(latitude_deg: float, longitude_deg: float, altitude_m: float) -> tuple[float, float, float]:
    """Return a point from the middle of the Earth [m]: x to latitude and longitude 0, z to the north pole."""
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    sin, cos = math.sin(latitude), math.cos(latitude)
    across_m = SEMI_MAJOR_M / math.sqrt(1.0 - E2 * sin * sin)  # radius of curvature across the meridian
    return (
        (across_m + altitude_m) * cos * math.cos(longitude),
        (across_m + altitude_m) * cos * math.sin(longitude),
        (across_m * (1.0 - E2) + altitude_m) * sin,
    )
