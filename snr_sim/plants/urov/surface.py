"""A body at the surface: its wet fraction, the centre of that, and whether a thruster draws air.

The displaced volume is spread evenly over the box of the vehicle's frame, around the centre of buoyancy: 64 small
boxes, each wet as far as it is under water. Level, that is exact; tilted, each small box counts as level. The small
boxes to either side make the stiffness in roll and pitch that floats have.
"""

from __future__ import annotations

import itertools
import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.urov.vehicle import Vector, Vehicle

Array: TypeAlias = NDArray[np.float64]
Columns: TypeAlias = tuple[Array, Array, Array]  # x, y and z of many points

CUTS = 4  # along each side of the box: its second moments are 6 % short
PROPELLER_M = 0.0381  # radius, T200


class Surface:
    """The shape of one vehicle, for the moments in which it is not under water."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._size = vehicle.size_m
        self._centre = vehicle.centre_of_buoyancy_m
        steps = [(i + 0.5) / CUTS - 0.5 for i in range(CUTS)]
        box = np.array(list(itertools.product(steps, repeat=3)))
        places = box * np.array(vehicle.size_m) + np.array(vehicle.centre_of_buoyancy_m)
        # Not products by `@`: those are OpenBLAS's, which rounds otherwise on other processors.
        self._places = _columns(places)
        self._moments = np.vstack([np.ones(len(places)), places.T]) / len(places)
        self._thrusters = _columns(np.array([one.position_m for one in vehicle.thrusters]).reshape(-1, 3))
        box_m = 0.5 * math.hypot(*vehicle.size_m) + math.hypot(*vehicle.centre_of_buoyancy_m)
        # No part is farther from the body's origin.
        self.reach_m: float = max([box_m, *(math.hypot(*one.position_m) + PROPELLER_M for one in vehicle.thrusters)])

    def submerged_fraction(self, z_m: float, up_body: Vector) -> tuple[float, Vector]:
        """Return the wet fraction of the displaced volume, and the centre of the wet part [m], body frame.

        The origin is `z_m` over the surface; `up_body` is the world's upward direction in the body frame.
        """
        # A small box counts as high as its sides reach up, taken together as at right angles: then a slight tilt makes
        # it no higher, and neighbours above each other do not overlap.
        a, b, c = up_body
        length, width, height = self._size
        slope = -CUTS / math.hypot(a * length, b * width, c * height)
        wet = _between_0_and_1(_along(self._places, (slope * a, slope * b, slope * c)) + (0.5 + slope * z_m))
        total, x, y, z = np.add.reduce(self._moments * wet, 1).tolist()
        if total <= 0.0:
            return 0.0, self._centre
        if total > 1.0 - 1e-12:
            return 1.0, self._centre
        return total, (x / total, y / total, z / total)

    def propeller_immersion(self, z_m: float, up_body: Vector) -> Array:
        """Return the fraction of each propeller's disc that is in the water, shape (n,)."""
        heights = z_m + _along(self._thrusters, up_body)
        return _between_0_and_1(0.5 - heights / (2.0 * PROPELLER_M))


def _columns(places: Array) -> Columns:
    x, y, z = (column.copy() for column in places.T)
    return x, y, z


def _along(places: Columns, vector: Vector) -> Array:
    """Return the dot product of each point with a vector, such as its height along a direction."""
    (x, y, z), (a, b, c) = places, vector
    return a * x + b * y + c * z


def _between_0_and_1(values: Array) -> Array:
    """Clip in place; `numpy.clip` takes ten times as long for so few."""
    np.maximum(values, 0.0, out=values)
    np.minimum(values, 1.0, out=values)
    return values
