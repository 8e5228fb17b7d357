"""A pilot dives and comes back: yours, or the one that is written here.

A person needs both roles in real time, each in a terminal of its own:

    snr run urov_teleop --role urov
    snr run urov_teleop --role topside --option pilot=keyboard      (or pilot=pad)

Without a person, `snr run urov_teleop` lets a script swim a square at 1.5 m. Criterion: it was deeper than 1 m, it is
back at the surface with its thrusters still, and it has touched nothing harder than 60 N.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import Any

from snr_sim_robot_urov.judging import Watched, WatchedUrov
from snr_sim_robot_urov.parameters import UrovParameters, vehicle
from snr_sim_robot_urov.pilot import Cue

from snr_sim.plants.dive import Current, Dive
from snr_sim.plants.pool import Gate, Pool
from snr_sim.plants.propulsion import Propulsion
from snr_sim.plants.tether import Tether
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.scenario import Verdict

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
TIME_LIMIT_S = 1800.0  # a person takes a while

POOL = Pool(25.0, 12.5, 4.0, gates=(Gate("gate_red", (4.0, 0.0, -1.5)), Gate("gate_yellow", (8.0, 2.0, -2.0), 0.6)))
DEEP_M, BACK_M, STILL_N, HARD_N = 1.0, 0.35, 0.2, 60.0
DOWN_M, LEG_S, ARM_S = 1.5, 5.0, 2.0


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Returns where the run of a seed begins, and its current."""
    rng = rng_for(seed, "dive")
    speed, way = rng.uniform(0.0, 0.05), rng.uniform(-math.pi, math.pi)
    return Dive(
        position_m=(rng.uniform(-6.0, -5.0), rng.uniform(-2.0, -1.0), -0.15),
        attitude_rad=(0.0, 0.0, rng.uniform(-0.3, 0.3)),
        currents=(Current(0.0, (speed * math.cos(way), speed * math.sin(way), 0.0)),),
        tether=Tether(anchor_m=(-12.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Returns what the controller may know, and what the pilot does if nobody is there."""
    legs = [
        Cue(12.0 + i * (LEG_S + 3.0), surge=0.5, heading_rad=math.remainder(i * 0.5 * math.pi, 2.0 * math.pi))
        for i in range(4)
    ]
    turns = [
        Cue(12.0 + i * (LEG_S + 3.0) + LEG_S, surge=0.0, heading_rad=math.remainder((i + 1) * 0.5 * math.pi, math.tau))
        for i in range(4)
    ]
    script = [
        Cue(ARM_S, is_armed=True, mode="heading_hold", depth_m=DOWN_M, heading_rad=0.0),
        *sorted([*legs, *turns], key=lambda cue: cue.at_s),
        Cue(45.0, depth_m=0.1),
        Cue(54.0, is_armed=False),
    ]
    return UrovParameters(vehicle(), tuple(script))


def plant(seed: int, engine: str) -> Watched:
    """Returns the vehicle at its start."""
    return WatchedUrov(vehicle(), POOL, dive, Propulsion(8), seed)


def verdict(plant: Watched) -> Verdict | None:
    """Returns how it ended, or None while it dives."""
    if plant.touched_n > HARD_N:
        return Verdict("crashed", False, f"it hit something with {plant.touched_n:.0f} N, more than {HARD_N:g} N")
    forces = plant.thrusters.forces_n if plant.thrusters is not None else []
    is_back = -plant.position_m[2] < BACK_M and max(map(abs, forces), default=0.0) < STILL_N
    return Verdict("home", True) if is_back and _deepest_m(plant) > DEEP_M else None


def metrics(plant: Watched, seed: int) -> dict[str, Any]:
    """Returns what the pilot made of it."""
    course = plant.course
    way_m = sum(math.dist(one.position_m, other.position_m) for one, other in pairwise(course))
    return {
        "deepest_m": _deepest_m(plant),
        "way_m": way_m,
        "touched_n": plant.touched_n,
        "energy_j": plant.thrusters.energy_j,
    }


def _deepest_m(plant: Watched) -> float:
    return max((sample.depth_m for sample in plant.course), default=0.0)
