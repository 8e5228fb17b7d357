"""Stay where you are: after 12 s the water begins to move, and the pilot, who sees it, keeps the vehicle in position.

Station was kept if, from 15 s after the current began, the vehicle is within 30 cm of its position and 20 cm of its
depth.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.evaluation import TrackedUrov, hold_verdict
from snr_sim_robot_urov.parameters import UrovParameters, vehicle
from snr_sim_robot_urov.waypoint_pilot import Waypoint

from snr_sim.plants import Current, Dive, Pool, Propulsion, Tether
from snr_sim.scenario import Verdict, rng_for

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
END_S = 42.0
TIME_LIMIT_S = END_S + 1.0

DEPTH_M = 2.0
CURRENT_S, KEPT_S = 12.0, 27.0
POSITION_BAND_M, DEPTH_BAND_M = 0.3, 0.2


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return what happens in the run of a seed."""
    rng = rng_for(seed, "dive")
    speed, direction = rng.uniform(0.15, 0.25), rng.uniform(-math.pi, math.pi)
    return Dive(
        position_m=(0.0, 0.0, -DEPTH_M),
        attitude_rad=(0.0, 0.0, rng.uniform(-math.pi, math.pi)),
        currents=(Current(CURRENT_S, (speed * math.cos(direction), speed * math.sin(direction), 0.0)),),
        tether=Tether(anchor_m=(0.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's target position."""
    return UrovParameters(vehicle(), route=(Waypoint(0.0, 0.0, DEPTH_M, dive(seed).attitude_rad[2]),))


def plant(seed: int, engine: str) -> TrackedUrov:
    """Return the vehicle at its start."""
    return TrackedUrov(vehicle(), Pool(25.0, 25.0, 5.0), dive, Propulsion(8), seed)


def verdict(plant: TrackedUrov) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    found, misses = metrics(plant, 0), []
    if found["place_error_m"] > POSITION_BAND_M:
        misses.append(f"position error was {found['place_error_m']:.2f} m (limit {POSITION_BAND_M:g} m)")
    if found["depth_error_m"] > DEPTH_BAND_M:
        misses.append(f"depth error was {found['depth_error_m']:.2f} m (limit {DEPTH_BAND_M:g} m)")
    return hold_verdict(plant, misses)


def metrics(plant: TrackedUrov, seed: int) -> dict[str, Any]:
    """Return how far off it was: at worst, and after it had time to answer the current."""
    worst, kept = plant.samples_between(CURRENT_S, KEPT_S), plant.samples_between(KEPT_S, END_S)
    return {
        "place_error_m": max((math.hypot(*sample.position_m[:2]) for sample in kept), default=None),
        "worst_place_error_m": max((math.hypot(*sample.position_m[:2]) for sample in worst), default=None),
        "depth_error_m": max((abs(sample.depth_m - DEPTH_M) for sample in [*worst, *kept]), default=None),
        "energy_j": plant.thrusters.energy_j,
    }
