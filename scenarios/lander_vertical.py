"""A lunar module straight above flat ground, with one engine and a radar: when must it burn?

Seed 0 begins 1000 m up, at rest, with 8000 kg (the case LM_1km of the reference table). Every other seed is another
height, speed and mass. It lands if the gear takes the touchdown. Nothing breaks.
"""

from __future__ import annotations

from typing import Any

from snr_sim_robot_lander.evaluation import judge, vertical_metrics
from snr_sim_robot_lander.parameters import APOLLO, DRY_MASS_KG, LanderParameters

from snr_sim.plants import Lander1D, VerticalStart
from snr_sim.scenario import Verdict, rng_for

ROBOT = "lander"
ENGINES = ("closed_form",)
CONTROLLER = "optimal"
TIME_LIMIT_S = 240.0


def start(seed: int) -> VerticalStart:
    """Return where the run of a seed begins."""
    height, velocity, mass = 1000.0, 0.0, 8000.0
    if seed != 0:
        rng = rng_for(seed, "start")
        height, velocity, mass = rng.uniform(600.0, 1500.0), rng.uniform(-25.0, 5.0), rng.uniform(7500.0, 8500.0)
    return VerticalStart(height, velocity, mass, fuel_kg=mass - DRY_MASS_KG)


def parameters(seed: int) -> LanderParameters:
    """Return the parameters for the controller."""
    begin = start(seed)
    return LanderParameters(mass_kg=begin.mass_kg, fuel_kg=begin.fuel_kg)


def plant(seed: int, engine: str) -> Lander1D:
    """Return the module at its start."""
    return Lander1D(start, parameters(seed).engine, seed, gear=APOLLO.gear)


def verdict(plant: Lander1D) -> Verdict | None:
    """Return how it ended, or None while it flies."""
    return judge(plant)


def metrics(plant: Lander1D, seed: int) -> dict[str, Any]:
    """Return the touchdown, and the propellant relative to the minimum."""
    return vertical_metrics(plant, start(seed), parameters(seed).engine)
