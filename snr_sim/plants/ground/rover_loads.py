"""How the ground's pressure is shared by the wheels of a rover that drives in the plane.

Forces at the wheels shift weight: to those behind when it speeds up, to those outside in a curve, and from one wheel of
a bogie to the other when both push. A wheel counts to the part that carries its motor, and each part is in balance:

    all           sum of loads = weight; about the x axis, loads against side forces that act below the center of mass
    a bogie       about its pivot
    rocker+bogie  about the rocker's pivot, with a moment of the differential, the same on both sides
    chassis       about the same pivot; the differential takes half of its moment to each side

A rocker-bogie with six wheels has six loads and six equations. Where there are fewer equations, as for wheels that are
fixed to the chassis, the loads are those of equal springs under a rigid body: those with the least sum of squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from snr_sim.plants.ground.rover_arms import SIDES, Arm, Place, arms_of, wheel_inertia_kgm2
from snr_sim.plants.ground.rover_vehicle import RoverVehicle, Wheel
from snr_sim.plants.matrices import inverse, product
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.sums import dot_product, ordered_sum

Row = tuple[float, ...]  # a number for each wheel


class Mass(NamedTuple):
    """A part of the rover."""

    mass_kg: float
    center_m: Place
    yaw_kgm2: float  # about its own center


class Lever(NamedTuple):
    """What turns about a pivot: masses, and the wheels under them."""

    pivot_m: tuple[float, float]  # x and z
    masses: list[Mass]
    wheels: list[Wheel]


class Balance(NamedTuple):
    """One equation: loads times those of the wheels = weight times gravity + drives times forces ahead + sides."""

    loads: Row
    weight: float
    drives: Row
    sides: Row


class RoverLoads:
    """Mass of a rover in the plane, and the loads of its wheels.

    Attributes:
        mass_kg: of all.
        center_m: x and y of its center of mass.
        yaw_kgm2: inertia about it.
    """

    def __init__(self, vehicle: RoverVehicle) -> None:
        body, arms = _levers(vehicle)
        masses = [*body.masses, *(mass for rocker, _ in arms for mass in rocker.masses)]
        self.mass_kg: float = vehicle.mass_kg
        x_m, y_m, self._height_m = (self._mean(masses, axis) for axis in range(3))
        self.center_m: tuple[float, float] = (x_m, y_m)
        self.yaw_kgm2: float = ordered_sum(
            one.yaw_kgm2 + one.mass_kg * ((one.center_m[0] - x_m) ** 2 + (one.center_m[1] - y_m) ** 2) for one in masses
        )
        wheels, mass_kg = vehicle.wheels, self.mass_kg
        none = (0.0,) * len(wheels)
        across = tuple(wheel.position_m[1] for wheel in wheels)
        rows = [
            Balance((1.0,) * len(wheels), mass_kg, none, none),
            Balance(across, mass_kg * y_m, none, (-self._height_m,) * len(wheels)),
        ]
        turning = self._about_pivot(vehicle, body)
        for rocker, bogie in arms:
            rows.append(self._about_pivot(vehicle, bogie))
            rows.append(_sum(self._about_pivot(vehicle, rocker), turning, 0.5))
        if not arms:
            rows.append(turning)
        equations = np.array([row.loads for row in rows])
        try:
            solution = product(equations.T, inverse(product(equations, equations.T)))
        except ParameterError as error:
            raise ParameterError(
                f"The wheels of the rover at {[wheel.position_m for wheel in vehicle.wheels]} do not hold it upright.",
                fix="give wheels before and behind the center of mass and the pivots, on both sides.",
            ) from error
        self._at_rest = [dot_product(one, (row.weight for row in rows)) for one in solution.tolist()]
        drives, sides = (
            product(solution, np.array(each)) for each in zip(*((r.drives, r.sides) for r in rows), strict=True)
        )
        self._by_drive, self._by_side = drives.tolist(), sides[:, 0].tolist()  # all side forces count alike

    def _mean(self, masses: list[Mass], axis: int) -> float:
        return ordered_sum(one.mass_kg * one.center_m[axis] for one in masses) / self.mass_kg

    def _about_pivot(self, vehicle: RoverVehicle, lever: Lever) -> Balance:
        """Return the balance of moments of a lever; what speeds up the rover pulls at its masses."""
        x_m, z_m = lever.pivot_m
        height = ordered_sum(one.mass_kg * (one.center_m[2] - z_m) for one in lever.masses) / self.mass_kg
        return Balance(
            tuple(wheel.position_m[0] - x_m if wheel in lever.wheels else 0.0 for wheel in vehicle.wheels),
            ordered_sum(one.mass_kg * (one.center_m[0] - x_m) for one in lever.masses),
            tuple(-height - (z_m if wheel in lever.wheels else 0.0) for wheel in vehicle.wheels),
            (0.0,) * len(vehicle.wheels),
        )

    def shared(self, pressure_mps2: float, drives_n: Sequence[float], side_n: float) -> list[float]:
        """Return the load of each wheel [N]; one that would be pulled down has none.

        Args:
            pressure_mps2: gravity across the ground.
            drives_n: force of the ground on each wheel, ahead.
            side_n: of all wheels together, to the left.
        """
        loads_n = (
            pressure_mps2 * at_rest + dot_product(by_drive, drives_n) + by_side * side_n
            for at_rest, by_drive, by_side in zip(self._at_rest, self._by_drive, self._by_side, strict=True)
        )
        return [load_n if load_n > 0.0 else 0.0 for load_n in loads_n]


def _levers(vehicle: RoverVehicle) -> tuple[Lever, list[tuple[Lever, Lever]]]:
    """Return the chassis, and rocker (with its bogie) and bogie of each side."""
    fixed = [wheel for wheel in vehicle.wheels if wheel.hangs_on == "chassis"]
    chassis = Mass(vehicle.chassis_kg, vehicle.center_of_mass_m, vehicle.inertia_kgm2[2])
    body = Lever((0.0, 0.0), [chassis, *map(_mass_of, fixed)], fixed)
    if vehicle.suspension is None:
        return body, []
    arms = []
    for side in SIDES:
        rocker, bogie = map(_lever, arms_of(vehicle, side))
        whole = Lever(rocker.pivot_m, [*rocker.masses, *bogie.masses], [*rocker.wheels, *bogie.wheels])
        arms.append((whole, bogie))
    return body._replace(pivot_m=vehicle.suspension.rocker_pivot_m), arms


def _lever(arm: Arm) -> Lever:
    x, y, z = (a + b for a, b in zip(arm.pivot_m, arm.middle_m(), strict=True))
    masses = [Mass(arm.mass_kg, (x, y, z), arm.inertia_kgm2()[2]), *map(_mass_of, arm.wheels)]
    return Lever((arm.pivot_m[0], arm.pivot_m[2]), masses, arm.wheels)


def _mass_of(wheel: Wheel) -> Mass:
    return Mass(wheel.mass_kg, wheel.position_m, wheel_inertia_kgm2(wheel)[2])


def _sum(one: Balance, other: Balance, share: float) -> Balance:
    """Return an equation plus a share of another one."""
    added = [
        tuple(a + share * b for a, b in zip(mine, more, strict=True))
        for mine, more in zip((one.loads, one.drives, one.sides), (other.loads, other.drives, other.sides), strict=True)
    ]
    return Balance(added[0], one.weight + share * other.weight, added[1], added[2])
