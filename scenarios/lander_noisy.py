"""The last hundred metres, in the dust that the engine blows up: the radar is read twenty times a second, and badly.

A reading of the height is wrong by 4 m, one of the speed by 1 m/s (standard deviations; noise). Every seed is another
height, speed and mass. It lands if the gear takes the touchdown. Nothing breaks.
"""

from __future__ import annotations

from typing import Any

from snr_sim_robot_lander.evaluation import judge, vertical_metrics
from snr_sim_robot_lander.parameters import APOLLO, DRY_MASS_KG, LanderParameters, SensorLevel

from snr_sim.devices import SensorErrors
from snr_sim.plants import Lander1D, VerticalStart
from snr_sim.scenario import Verdict, rng_for

ROBOT = "lander"
ENGINES = ("closed_form",)
CONTROLLER = "hover_and_drop"
TIME_LIMIT_S = 120.0

NOISY_RADAR = SensorLevel(20.0, SensorErrors(noise={"altitude_m": 4.0, "velocity_mps": 1.0}))


def start(seed: int) -> VerticalStart:
    """Return where the run of a seed begins."""
    height, velocity, mass = 100.0, -4.0, 7500.0
    if seed != 0:
        rng = rng_for(seed, "start")
        height, velocity, mass = rng.uniform(80.0, 120.0), rng.uniform(-6.0, -2.0), rng.uniform(7400.0, 7600.0)
    return VerticalStart(height, velocity, mass, fuel_kg=mass - DRY_MASS_KG)


def parameters(seed: int) -> LanderParameters:
    """Return the parameters for the controller."""
    begin = start(seed)
    return LanderParameters(begin.mass_kg, begin.fuel_kg, radar=NOISY_RADAR, engine_hz=20.0)


def plant(seed: int, engine: str) -> Lander1D:
    """Return the module at its start."""
    return Lander1D(start, parameters(seed).engine, seed, gear=APOLLO.gear)


def verdict(plant: Lander1D) -> Verdict | None:
    """Return how it ended, or None while it flies."""
    return judge(plant)


def metrics(plant: Lander1D, seed: int) -> dict[str, Any]:
    """Return the touchdown, and the propellant relative to the minimum."""
    return vertical_metrics(plant, start(seed), parameters(seed).engine)
