"""Rockers and bogies of a rover, and its wheels, as masses."""

from __future__ import annotations

from typing import NamedTuple

from snr_sim.plants.ground.rover_vehicle import RoverVehicle, Wheel
from snr_sim.prelude.sums import dot_product, ordered_sum

Place = tuple[float, float, float]
SIDES = ("left", "right")


class Arm(NamedTuple):
    """A rocker or a bogie: thin rods of equal mass from its pivot to what it carries."""

    kind: str  # "rocker" or "bogie"
    side: str
    mass_kg: float
    pivot_m: Place
    ends_m: list[Place]
    wheels: list[Wheel]

    def rods_m(self) -> list[list[float]]:
        """Return each rod, from the pivot."""
        return [[b - a for a, b in zip(self.pivot_m, end, strict=True)] for end in self.ends_m]

    def middle_m(self) -> list[float]:
        """Return the center of mass, from the pivot."""
        rods = self.rods_m()
        return [ordered_sum(rod[i] for rod in rods) * 0.5 / len(rods) for i in range(3)]

    def inertia_kgm2(self) -> list[float]:
        """Return the inertia about the center of mass: roll, pitch, yaw."""
        share, rods, middle = self.mass_kg / len(self.ends_m), self.rods_m(), self.middle_m()
        inertia = [1e-4 * self.mass_kg] * 3
        for rod in rods:
            length2 = dot_product(rod, rod)
            away = [0.5 * x - m for x, m in zip(rod, middle, strict=True)]
            for i in range(3):
                inertia[i] += share * (length2 - rod[i] ** 2) / 12.0
                inertia[i] += share * (dot_product(away, away) - away[i] ** 2)
        return inertia


def arms_of(vehicle: RoverVehicle, side: str) -> tuple[Arm, Arm]:
    """Return rocker and bogie of a side of a vehicle with a suspension."""
    hung = vehicle.suspension
    assert hung is not None
    # Wheels of the chassis do not count: a caster in the middle would move the pivots of one side.
    ours = [wheel for wheel in vehicle.wheels if wheel.side == side and wheel.hangs_on != "chassis"]
    y = ordered_sum(wheel.position_m[1] for wheel in ours) / len(ours)
    pivot = (hung.rocker_pivot_m[0], y, hung.rocker_pivot_m[1])
    bogie = (hung.bogie_pivot_m[0], y, hung.bogie_pivot_m[1])
    on_rocker, on_bogie = ([wheel for wheel in ours if wheel.hangs_on == part] for part in ("rocker", "bogie"))
    return (
        Arm("rocker", side, hung.rocker_kg, pivot, [*(wheel.position_m for wheel in on_rocker), bogie], on_rocker),
        Arm("bogie", side, hung.bogie_kg, bogie, [wheel.position_m for wheel in on_bogie], on_bogie),
    )


def wheel_inertia_kgm2(wheel: Wheel) -> Place:
    """Return the inertia of a wheel, a disk about its axle: roll, pitch, yaw."""
    across = wheel.mass_kg * (3.0 * wheel.radius_m**2 + wheel.width_m**2) / 12.0
    return across, 0.5 * wheel.mass_kg * wheel.radius_m**2, across
