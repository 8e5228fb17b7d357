"""An underwater vehicle as numbers: mass, added mass, damping, buoyancy, and where its thrusters are.

The numbers of one vehicle are in a file (`vehicle_file.py`); they are checked here, where the mistake was made.
Coefficients that oppose a motion or add mass are positive. All is in the body frame: x forward, y left, z up.

A wrench has six numbers: force along x, y, z [N], then moment about x, y, z [N m].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, TypeAlias

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.parameter_limits import (
    FINITE,
    LIMITS,
    MILLIMETRES,
    Limit,
    check_number,
    check_record,
    format_value,
)
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.sums import ordered_sum
from snr_sim.prelude.wrench import AXES

LEAD_KGM3 = 11340.0
OUTRIGGER_M = 0.1  # how far a propeller may sit outside the frame

Vector: TypeAlias = tuple[float, float, float]
Six: TypeAlias = tuple[float, float, float, float, float, float]
Matrix: TypeAlias = NDArray[np.float64]  # 6 x 6, or 6 x n


@dataclass(frozen=True)
class Thruster:
    """Position and direction of one thruster.

    Args:
        position_m: of its propeller, body frame.
        direction: of its force on the vehicle when it runs ahead, body frame; made a unit vector.
    """

    name: str
    position_m: Annotated[Vector, LIMITS["body_position_m"]]
    direction: Annotated[Vector, FINITE]

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip():
            raise ParameterError(f"A thruster is named {format_value(self.name)}.", fix='give it a name, such as "T1".')
        who = f"Thruster '{self.name}'"
        check_record(self, f"{who}: ")
        length = math.hypot(*self.direction)
        if not 0.99 < length < 1.01:
            raise ParameterError(
                f"{who} has a direction that is {length:g} long.",
                fix="give a direction of length 1, such as [1.0, 0.0, 0.0] for straight ahead.",
            )
        x, y, z = self.direction
        object.__setattr__(self, "direction", (x / length, y / length, z / length))


@dataclass(frozen=True)
class Vehicle:
    """The numbers of one vehicle, in the body frame. Its origin is where added mass and damping are given.

    Args:
        name: of the set of numbers.
        mass_kg: dry, as printed. With `net_buoyancy_n`, the plant's is the result of `trimmed`, up to a tenth off.
        inertia_kgm2: 3 x 3, about the centre of mass.
        volume_m3: of the water it displaces.
        added_mass: 6 x 6, symmetric.
        linear_damping: per axis, N/(m/s) and N m/(rad/s).
        quadratic_damping: per axis, N/(m/s)^2 and N m/(rad/s)^2.
        centre_of_mass_m, centre_of_buoyancy_m: of the dry vehicle, and of the displaced water.
        size_m: length, width and height of its frame: what meets walls, and over which it gets wet at the surface.
        thrusters: in the order of their pulses.
        net_buoyancy_n: how much buoyancy is to exceed weight; None leaves the mass as it is.
        sources: where each number is from, by its name.

    Raises:
        ParameterError: a number is out of range; the message names it.
    """

    name: str
    mass_kg: Annotated[float, LIMITS["mass_kg"]]
    inertia_kgm2: Annotated[Matrix, FINITE, AXES[3:]]
    volume_m3: Annotated[float, LIMITS["volume_m3"]]
    added_mass: Annotated[Matrix, FINITE, AXES]
    linear_damping: Annotated[Six, LIMITS["linear_damping"]]
    quadratic_damping: Annotated[Six, LIMITS["quadratic_damping"]]
    centre_of_mass_m: Annotated[Vector, LIMITS["body_position_m"]] = (0.0, 0.0, 0.0)
    centre_of_buoyancy_m: Annotated[Vector, LIMITS["body_position_m"]] = (0.0, 0.0, 0.0)
    size_m: Annotated[Vector, LIMITS["size_m"], ("length", "width", "height")] = (0.457, 0.575, 0.254)
    thrusters: Annotated[tuple[Thruster, ...], "Thruster(...)"] = ()
    net_buoyancy_n: Annotated[float | None, LIMITS["net_buoyancy_n"]] = None
    sources: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not isinstance(self.sources, dict):
            raise ParameterError(
                f"A vehicle is named {format_value(self.name)}, its sources are {format_value(self.sources)}.",
                fix='a text such as "mine", and a dict of texts, by the names of the numbers.',
            )
        check_record(self, self._what(""))
        for name in ("centre_of_mass_m", "centre_of_buoyancy_m"):
            for axis, value, size in zip("xyz", getattr(self, name), self.size_m, strict=True):
                inside = Limit(0.0, 0.5 * size, "m", "it is inside the frame, as size_m says", MILLIMETRES)
                check_number(self._what(f"{name}, off the middle in {axis},"), abs(value), inside)
        check_number(self._what("mass by volume"), self.mass_kg / self.volume_m3, LIMITS["density_kgm3"])
        self._check_inertia()
        self._check_added_mass()
        self._check_thrusters()

    def _what(self, name: str) -> str:
        return f"Vehicle '{self.name}': {name}"

    def _check_inertia(self) -> None:
        inertia, what = self.inertia_kgm2.tolist(), self._what("inertia_kgm2")
        lowest, middle, highest = np.linalg.eigvalsh(self.inertia_kgm2).tolist()  # decides no run: only checked
        if not lowest > 0.0:
            found = f"is {inertia}, about one axis {lowest:.3g}."
            raise ParameterError(f"{what} {found}", fix="an inertia is positive about any axis.")
        if lowest + middle < highest * (1.0 - 1e-9):
            found = f"is {inertia}: one is more than the two others together."
            raise ParameterError(f"{what} {found}", fix="no body is like that: look at the largest.")
        min_value = self.mass_kg**2 / (2.0 * math.pi * LEAD_KGM3 * max(self.size_m))
        if lowest < min_value:
            raise ParameterError(
                f"{what} has {lowest:.3g} kg m2 about one axis.",
                fix=f"at least {min_value:.2g}: {self.mass_kg:g} kg have that as a rod of lead as long as the frame, "
                "about that length; look at the unit, and at mass_kg and size_m, too.",
            )
        short, long = sorted(self.size_m)[1:]
        share = highest / (0.25 * self.mass_kg * (short * short + long * long))  # of all mass in the corners
        if not LIMITS["inertia_share"].contains(share):
            raise ParameterError(
                f"{what} has {highest:.3g} kg m2, {share:.1f} times the most that {self.mass_kg:g} kg can have in this "
                "frame.",
                fix=f"{LIMITS['inertia_share'].reason}; look at mass_kg and size_m, too.",
            )

    def _check_added_mass(self) -> None:
        added, what = self.added_mass, self._what("added_mass")
        water = 1000.0 * self.volume_m3
        corner = water * 0.25 * ordered_sum(side * side for side in self.size_m)
        share = LIMITS["added_mass_share"]
        reason = f"it is given as a positive number, and {share.reason}"
        for i, axis in enumerate(AXES):
            max_value, unit = share.max_value * (water if i < 3 else corner), "kg" if i < 3 else "kg m2"
            check_number(what, float(added[i, i]), Limit(0.0, max_value, unit, reason, share.unit_mistakes), axis)
        min_value = float(np.linalg.eigvalsh(added)[0])  # decides no run: only checked
        if min_value < -1e-9 * float(np.abs(added).max()):
            raise ParameterError(
                f"{what} is {added.tolist()}: moved one way, the water would have less energy than at rest.",
                fix="look at what is off the diagonal: it is too large.",
            )

    def _check_thrusters(self) -> None:
        names = ["".join(thruster.name.split()) for thruster in self.thrusters]  # blanks make no other name
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ParameterError(
                f"Vehicle '{self.name}' has more than one thruster named '{twice[0]}'.",
                fix="give each its own name, by more than blanks.",
            )
        reason = f"it is fixed to the frame, as size_m says, {OUTRIGGER_M:g} m outside at most"
        for thruster in self.thrusters:
            for axis, value, size in zip("xyz", thruster.position_m, self.size_m, strict=True):
                limit = Limit(0.0, 0.5 * size + OUTRIGGER_M, "m", reason)
                check_number(f"Thruster '{thruster.name}': position_m, off the middle in {axis},", abs(value), limit)

    def trimmed(self, density_kgm3: float, gravity_mps2: float) -> Vehicle:
        """Return the vehicle with the ballast that gives it `net_buoyancy_n` in this water.

        Ballast is put on or taken off at the centre of mass, so that stays, and the inertia is not changed. Without
        `net_buoyancy_n` the vehicle is what it is.

        Raises:
            ParameterError: the ballast would be more than a tenth of the mass: then mass, volume and net buoyancy
                contradict each other.
        """
        check_number("The density of the water", density_kgm3, LIMITS["water_kgm3"])
        check_number("The gravity", gravity_mps2, LIMITS["gravity_mps2"])
        if self.net_buoyancy_n is None:
            return self
        mass = density_kgm3 * self.volume_m3 - self.net_buoyancy_n / gravity_mps2
        if not LIMITS["ballast_share"].contains((mass - self.mass_kg) / self.mass_kg):
            raise ParameterError(
                f"Vehicle '{self.name}' has mass_kg {self.mass_kg:g}; to float up with net_buoyancy_n "
                f"{self.net_buoyancy_n:g} in water of {density_kgm3:g} kg/m3, {1e3 * self.volume_m3:g} l must "
                f"weigh {mass:.4g} kg.",
                fix="correct mass_kg or volume_m3, or leave out net_buoyancy_n, and it weighs what it weighs: "
                f"{LIMITS['ballast_share'].reason}.",
            )
        return replace(self, mass_kg=mass)

    def thruster_matrix(self) -> Matrix:
        """Return 6 x n: column i is the wrench of thruster i at 1 N ahead, about the origin."""
        columns = [[*one.direction, *np.cross(one.position_m, one.direction).tolist()] for one in self.thrusters]
        return np.array(columns).reshape(-1, 6).T
