"""What a vehicle weighs and what carries it: dry mass, what hangs at it, what leaked in, and the part that is wet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from snr_sim.plants.matrices import product
from snr_sim.plants.urov.dive import Payload
from snr_sim.plants.urov.vehicle import Matrix, Vector, Vehicle


class Flotation:
    """Weight and buoyancy of one vehicle, whose dry mass matrix is `rigid` (6 x 6)."""

    def __init__(self, vehicle: Vehicle, rigid: Matrix, density_kgm3: float, gravity_mps2: float) -> None:
        self._rigid, self._density, self._gravity = rigid, density_kgm3, gravity_mps2
        self._centre = vehicle.centre_of_buoyancy_m
        self._buoyancy_n = density_kgm3 * gravity_mps2 * vehicle.volume_m3
        self.load((), 0.0)

    def load(self, loads: Sequence[Payload], water_l: float, water_at: Vector = (0.0, 0.0, 0.0)) -> None:
        """Compute weight and buoyancy again; payloads count with their own buoyancy, as if always under water.

        Leaked water is `water_at`, body frame.
        """
        rigid, gravity, density = self._rigid, self._gravity, self._density
        weight = gravity * float(rigid[0, 0])
        # The mass matrix contains mass times position: m z at [0, 4], m x at [1, 5], m y at [2, 3].
        static_moment_nm = [gravity * float(rigid[1, 5]), gravity * float(rigid[2, 3]), gravity * float(rigid[0, 4])]
        parts = [(one.mass_kg, one.mass_kg - density * one.volume_m3, one.position_m) for one in loads]
        if water_l > 0.0:
            water_kg = 1e-3 * density * water_l
            parts.append((water_kg, water_kg, water_at))
        self.mass: Matrix = rigid.copy() if parts else rigid  # 6 x 6, dry vehicle and loads
        for mass_kg, heavy_kg, position in parts:
            self.mass += point_mass(mass_kg, position)
            weight += gravity * heavy_kg
            static_moment_nm = [a + gravity * heavy_kg * b for a, b in zip(static_moment_nm, position, strict=True)]
        self._weight_n, self._weight_arm = weight, static_moment_nm
        self.set_submerged(1.0, self._centre)

    def set_submerged(self, share: float, centre: Vector) -> None:
        """Set the fraction of the volume that is in the water, and its centre."""
        force = share * self._buoyancy_n
        self.net_n: float = force - self._weight_n  # buoyancy less weight
        x, y, z = (force * a - b for a, b in zip(centre, self._weight_arm, strict=True))
        # Each times its position [N m], body frame: the cross product with the upward direction is the righting moment.
        self.static_moment_nm: Vector = (x, y, z)

    def submerge(self) -> None:
        """Take all of the volume to be in the water."""
        self.set_submerged(1.0, self._centre)


def point_mass(mass_kg: float, position: Vector) -> Matrix:
    """Return the 6 x 6 mass matrix of a point mass that is fixed to the body at a position in its frame."""
    x, y, z = position
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return mass_kg * np.block([[np.eye(3), -cross], [cross, -product(cross, cross)]])
