"""An underwater vehicle as numbers: mass, added mass, damping, buoyancy, and where its thrusters are.

The numbers of one vehicle stand in a file (`vehicle_file.py`); what they must be like is checked here, where the
mistake was made. Coefficients that oppose a motion or add mass are positive. All is in the body frame: x forward,
y left, z up.

A wrench has six numbers: force along x, y, z [N], then moment about x, y, z [N m].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from snr_sim.prelude.errors import ParameterError, nearest
from snr_sim.prelude.wrench import AXES, lacking_axes

Vector: TypeAlias = tuple[float, float, float]
Six: TypeAlias = tuple[float, float, float, float, float, float]
Matrix: TypeAlias = NDArray[np.float64]  # 6 x 6, or 6 x n


@dataclass(frozen=True)
class Thruster:
    """Where one thruster is, and which way it pushes.

    Args:
        name: its own.
        position_m: of its propeller, body frame.
        direction: of its force on the vehicle when it runs ahead, body frame; made a unit vector.
    """

    name: str
    position_m: Vector
    direction: Vector

    def __post_init__(self) -> None:
        length = math.sqrt(sum(value * value for value in self.direction))
        if not math.isfinite(sum(self.position_m)) or not 0.99 < length < 1.01:
            raise ParameterError(
                f"Thruster '{self.name}' is at {self.position_m}; its direction {self.direction} is {length:g} long.",
                fix="give its place in metres and a direction of length 1.",
            )
        x, y, z = self.direction
        object.__setattr__(self, "direction", (x / length, y / length, z / length))


@dataclass(frozen=True)
class Vehicle:
    """The numbers of one vehicle, in the body frame. Its origin is where added mass and damping are given.

    Args:
        name: of the set of numbers.
        mass_kg: dry, with ballast.
        inertia_kgm2: 3 x 3, about the centre of mass.
        volume_m3: of the water it displaces.
        added_mass: 6 x 6, symmetric.
        linear_damping: per axis, N/(m/s) and N m/(rad/s).
        quadratic_damping: per axis, N/(m/s)^2 and N m/(rad/s)^2.
        centre_of_mass_m: of the dry vehicle.
        centre_of_buoyancy_m: of the displaced water.
        size_m: length, width and height of its frame: what meets walls, and over which it gets wet at the surface.
        thrusters: in the order of their pulses.
        net_buoyancy_n: what `trimmed` makes of it: how much buoyancy exceeds weight. None leaves the mass as it is.
        sources: where each number is from, by its name.

    Raises:
        ParameterError: a number that cannot be: the message names it.
    """

    name: str
    mass_kg: float
    inertia_kgm2: Matrix
    volume_m3: float
    added_mass: Matrix
    linear_damping: Six
    quadratic_damping: Six
    centre_of_mass_m: Vector = (0.0, 0.0, 0.0)
    centre_of_buoyancy_m: Vector = (0.0, 0.0, 0.0)
    size_m: Vector = (0.457, 0.575, 0.254)
    thrusters: tuple[Thruster, ...] = ()
    net_buoyancy_n: float | None = None
    sources: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("mass_kg", "volume_m3"):
            self._check(name, getattr(self, name) > 0.0, "it must be more than 0")
        for name in ("linear_damping", "quadratic_damping"):
            values = getattr(self, name)
            self._check(name, len(values) == 6, "it has a number per axis: surge, sway, heave, roll, pitch, yaw")
            for axis, value in zip(AXES, values, strict=True):
                self._check(
                    f"{name} of {axis}",
                    value >= 0.0,
                    "damping opposes motion, and stands here without its minus",
                    value,
                )
        self._check("size_m", min(self.size_m) > 0.0, "it must be more than 0")
        for name in ("centre_of_mass_m", "centre_of_buoyancy_m"):
            self._check(name, math.isfinite(sum(getattr(self, name))), "it must be finite")
        self._check_matrix("inertia_kgm2", 3)
        self._check_matrix("added_mass", 6)
        least = float(np.linalg.eigvalsh(self.inertia_kgm2)[0])
        self._check("inertia_kgm2", least > 0.0, "an inertia is positive about any axis")
        principal = np.linalg.eigvalsh(self.inertia_kgm2)
        is_body = principal[0] + principal[1] >= principal[2] * (1.0 - 1e-9)
        self._check("inertia_kgm2", bool(is_body), "no body has one inertia above the sum of the two others")
        for axis, value in zip(AXES, np.diag(self.added_mass).tolist(), strict=True):
            self._check(f"added_mass of {axis}", value >= 0.0, "it adds mass, and stands here without its minus", value)
        least = float(np.linalg.eigvalsh(self.added_mass)[0])
        scale = float(np.abs(self.added_mass).max())
        self._check("added_mass", least >= -1e-9 * scale, "water pushed aside has energy in any direction")
        names = [thruster.name for thruster in self.thrusters]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ParameterError(
                f"Vehicle '{self.name}' has more than one thruster named '{twice[0]}'.", fix="give each its own name."
            )

    def _check(self, what: str, is_right: bool, why: str, value: Any = None) -> None:
        if not is_right:
            found = getattr(self, what) if value is None else value
            raise ParameterError(f"Vehicle '{self.name}': {what} is {found}.", fix=f"{why}.")

    def _check_matrix(self, name: str, size: int) -> None:
        matrix = getattr(self, name)
        self._check(name, matrix.shape == (size, size), f"it is a matrix of {size} x {size}")
        self._check(name, bool(np.isfinite(matrix).all()), "all of it must be finite")
        self._check(name, bool(np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0)), "it is symmetric")

    def trimmed(self, density_kgm3: float, gravity_mps2: float) -> Vehicle:
        """Returns the vehicle with the ballast that gives it `net_buoyancy_n` in this water.

        Ballast is put on or taken off at the centre of mass, so that stays, and the inertia is not changed.
        """
        if self.net_buoyancy_n is None:
            return self
        mass = density_kgm3 * self.volume_m3 - self.net_buoyancy_n / gravity_mps2
        return replace(self, mass_kg=mass)

    def thruster_matrix(self) -> Matrix:
        """Returns 6 x n: column i is the wrench of thruster i at 1 N ahead, about the origin."""
        columns = [
            [*thruster.direction, *np.cross(thruster.position_m, thruster.direction).tolist()]
            for thruster in self.thrusters
        ]
        return np.array(columns).reshape(-1, 6).T

    def require_axes(self, axes: tuple[str, ...] = AXES) -> None:
        """Checks that the thrusters can push along and about all of these axes.

        Raises:
            ParameterError: they cannot; the message names the axes.
        """
        for axis in axes:
            if axis not in AXES:
                raise ParameterError(f"There is no axis '{axis}'.", fix=nearest(axis, AXES))
        lacking = [axis for axis in axes if axis in lacking_axes(self.thruster_matrix())]
        if lacking:
            raise ParameterError(
                f"The {len(self.thrusters)} thrusters of '{self.name}' have no authority in {', '.join(lacking)}.",
                fix="ask only for the other axes, or take a frame with thrusters that push there, such as benzon2022.",
            )
