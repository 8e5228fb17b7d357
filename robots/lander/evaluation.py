"""Judge of a landing, the same in every scenario: by the gear's limits, and by propellant relative to the minimum.

The minimum (`fuel_optimum_kg`) is that of a touchdown at the gear's limit, 3.05 m/s: letting the module fall on its
legs saves the last kilograms. To come to rest at the ground instead takes 7 % more from 1000 m, 18 % more from low
gate: `fuel_optimum_to_rest_kg`.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from snr_sim.plants import (
    Engine,
    GearLimits,
    Lander,
    Lander1D,
    Motion,
    PlaneStart,
    Terrain,
    VerticalStart,
    minimum_fuel_descent,
)
from snr_sim.plants.lander.module_shapes import PADS_BELOW_M
from snr_sim.scenario import Verdict

Landing: TypeAlias = Lander | Lander1D


def judge(plant: Landing) -> Verdict | None:
    """Return how it ended, or None while it flies."""
    return None if plant.outcome is None else Verdict(plant.outcome, plant.outcome == "landed", plant.reason)


def vertical_metrics(plant: Lander1D, start: VerticalStart, engine: Engine) -> dict[str, Any]:
    """Return touchdown and propellant of a vertical descent. The optimum is exact: nothing that lands needs less."""
    motion = Motion(start.height_m, start.velocity_mps, start.mass_kg)
    return _metrics(plant, start.fuel_kg - plant.fuel_kg, motion, engine, plant.gear)


def plane_metrics(plant: Lander, start: PlaneStart, ground: Terrain) -> dict[str, Any]:
    """Return touchdown and propellant of a descent in the plane.

    The optimum is that of the same descent straight down under the module, by an engine that runs at any throttle. It
    ignores the distance to the pad and the sideways speed: a lower bound that no flight reaches.
    """
    module = plant.module
    height = start.position_m[1] - PADS_BELOW_M - ground.ground(start.position_m[0])[0]
    motion = Motion(height, start.velocity_mps[1], start.mass_kg)
    engine = Engine(module.thrust_n, module.exhaust_mps, module.gravity_mps2)
    return _metrics(plant, start.fuel_kg - plant.fuel_kg, motion, engine, module.gear)


def _metrics(plant: Landing, fuel_kg: float, start: Motion, engine: Engine, gear: GearLimits) -> dict[str, Any]:
    optimum_kg = minimum_fuel_descent(start, engine, touchdown_mps=gear.vertical_mps).fuel_kg
    return {
        "touchdown": plant.touchdown and dict(plant.touchdown),
        "fuel_kg": fuel_kg,
        "fuel_optimum_kg": optimum_kg,
        "fuel_optimum_to_rest_kg": minimum_fuel_descent(start, engine).fuel_kg,
        "fuel_ratio": fuel_kg / optimum_kg if plant.outcome == "landed" else None,  # to fall costs nothing
    }
