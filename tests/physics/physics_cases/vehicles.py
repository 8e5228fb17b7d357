"""The vehicles of the cases, their water, and their initial states.

The vehicles: a set as it is ('benzon2022', 'wu2018'), 'neutral' (ballasted to weigh nothing in water), 'weightless'
(neutral, and its buoyancy where its mass is), 'undamped' (weightless without drag).
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.urov_state import WrenchCommand
from snr_sim.plants.urov.vehicle import Six, Vector, Vehicle
from snr_sim.plants.urov.vehicle_file import read_vehicle

SETS = ("benzon2022", "wu2018")
SEA = Pool(length_m=2000.0, width_m=2000.0, depth_m=200.0)
DEEP: Vector = (0.0, 0.0, -50.0)
CORNER: Vector = (950.0, -930.0, -120.0)  # far from the origin of the world
TILTED: Vector = (math.radians(45.0), math.radians(20.0), math.radians(130.0))
BASIN = Pool(length_m=20.0, width_m=20.0, depth_m=4.0)
NOTHING = (0.0,) * 6


@cache
def vehicle(name: str) -> Vehicle:
    """Return a set of numbers as it is in its file."""
    return read_vehicle(Path(__file__).parents[3] / "robots" / "urov" / "vehicles" / f"{name}.toml")


def trimmed(name: str) -> Vehicle:
    """Return it as it floats."""
    return vehicle(name).trimmed(SEA.density_kgm3, SEA.gravity_mps2)


def neutral(name: str) -> Vehicle:
    """Return it ballasted to weigh nothing in water."""
    return replace(vehicle(name), net_buoyancy_n=0.0).trimmed(SEA.density_kgm3, SEA.gravity_mps2)


def weightless(name: str) -> Vehicle:
    """Return it neutral, with its buoyancy where its mass is: nothing acts but what a case asks for."""
    return replace(neutral(name), centre_of_buoyancy_m=(0.0, 0.0, 0.0))


def undamped(one: Vehicle) -> Vehicle:
    """Return it in water without drag."""
    return replace(one, linear_damping=NOTHING, quadratic_damping=NOTHING)


def along_axis(one: Vehicle, axis: int) -> tuple[float, float, float]:
    """Return mass (or inertia) with the water's, linear and quadratic damping, of one whose origin is its centre."""
    dry = one.mass_kg if axis < 3 else float(one.inertia_kgm2[axis - 3, axis - 3])
    return dry + float(one.added_mass[axis, axis]), one.linear_damping[axis], one.quadratic_damping[axis]


def make_urov(one: Vehicle, step_s: float, pool: Pool = SEA, **how: Any) -> Urov:
    """Return a plant; `how` is its initial state as in Dive, by default deep under water."""
    dive = Dive(**{"position_m": DEEP, **how})
    return Urov(one, pool, lambda seed: dive, step_s=step_s)


def go(plant: Urov, time_s: float, wrench: Six | None = None) -> Urov:
    """Let time pass, under another wrench if one is given."""
    if wrench is not None:
        plant.write("wrench", WrenchCommand(list(wrench[:3]), list(wrench[3:])))
    for _ in range(round(time_s / plant.step_s)):
        plant.step(plant.step_s)
    return plant


def along(axis: int, value: float) -> Six:
    """Return six numbers, one of them not 0."""
    x, y, z, k, m, n = (value if i == axis else 0.0 for i in range(6))
    return x, y, z, k, m, n
