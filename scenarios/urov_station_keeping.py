"""Stay where you are: after 12 s the water begins to move, and the pilot, who sees it, keeps the vehicle in position.

Station was kept if, from 15 s after the current began, the vehicle is within 30 cm of its position and 20 cm of its
depth.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.judging import WatchedUrov, judged
from snr_sim_robot_urov.parameters import UrovParameters, vehicle
from snr_sim_robot_urov.seeing_pilot import Waypoint

from snr_sim.plants.urov.dive import Current, Dive
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.tether import Tether
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.scenario import Verdict

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
END_S = 42.0
TIME_LIMIT_S = END_S + 1.0

DEPTH_M = 2.0
CURRENT_S, KEPT_S = 12.0, 27.0
PLACE_BAND_M, DEPTH_BAND_M = 0.3, 0.2


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return what happens in the run of a seed."""
    rng = rng_for(seed, "dive")
    speed, way = rng.uniform(0.15, 0.25), rng.uniform(-math.pi, math.pi)
    return Dive(
        position_m=(0.0, 0.0, -DEPTH_M),
        attitude_rad=(0.0, 0.0, rng.uniform(-math.pi, math.pi)),
        currents=(Current(CURRENT_S, (speed * math.cos(way), speed * math.sin(way), 0.0)),),
        tether=Tether(anchor_m=(0.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's target position."""
    return UrovParameters(vehicle(), route=(Waypoint(0.0, 0.0, DEPTH_M, dive(seed).attitude_rad[2]),))


def plant(seed: int, engine: str) -> WatchedUrov:
    """Return the vehicle at its start."""
    return WatchedUrov(vehicle(), Pool(25.0, 25.0, 5.0), dive, Propulsion(8), seed)


def verdict(plant: WatchedUrov) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    found, misses = metrics(plant, 0), []
    if found["place_error_m"] > PLACE_BAND_M:
        misses.append(f"was {found['place_error_m']:.2f} m from its place, more than {PLACE_BAND_M:g} m")
    if found["depth_error_m"] > DEPTH_BAND_M:
        misses.append(f"was {found['depth_error_m']:.2f} m from its depth, more than {DEPTH_BAND_M:g} m")
    return judged(plant, misses)


def metrics(plant: WatchedUrov, seed: int) -> dict[str, Any]:
    """Return how far off it was: at worst, and after it had time to answer the current."""
    worst, kept = plant.during(CURRENT_S, KEPT_S), plant.during(KEPT_S, END_S)
    return {
        "place_error_m": max((math.hypot(*sample.position_m[:2]) for sample in kept), default=None),
        "worst_place_error_m": max((math.hypot(*sample.position_m[:2]) for sample in worst), default=None),
        "depth_error_m": max((abs(sample.depth_m - DEPTH_M) for sample in [*worst, *kept]), default=None),
        "energy_j": plant.thrusters.energy_j,
    }
