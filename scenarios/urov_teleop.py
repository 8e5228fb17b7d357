"""Fly it yourself, for five minutes: `snr run urov_teleop --speed real --view`. With a game controller or the keyboard.

    w s   ahead, astern     a d   left, right        1 2   arm, disarm       space   emergency stop
    i k   up, down          j l   turn left, right   - +   mode down, up     c       clear the stop

There are three gates. You have brought it home if it was a metre deep, is at the surface at the end, and hit nothing
with more than 50 N.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.judging import WatchedUrov, judged
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants.dive import Current, Dive
from snr_sim.plants.pool import Gate, Pool
from snr_sim.plants.propulsion import Propulsion
from snr_sim.plants.tether import Tether
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.scenario import Verdict

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
END_S = 300.0
TIME_LIMIT_S = END_S + 1.0

SURFACE_M, HARD_N = 0.4, 50.0


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Returns where the run of a seed begins, and its current."""
    rng = rng_for(seed, "dive")
    current = Current(0.0, (rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), 0.0))
    return Dive(position_m=(-9.0, 0.0, -0.5), currents=(current,), tether=Tether(anchor_m=(-9.0, 0.0, 0.0)))


def parameters(seed: int) -> UrovParameters:
    """Returns what the controller may know; a person flies."""
    return UrovParameters(vehicle(), is_flown_by_hand=True)


def plant(seed: int, engine: str) -> WatchedUrov:
    """Returns the vehicle at its start."""
    rng = rng_for(seed, "gates")
    gates = tuple(
        Gate(f"gate_{i + 1}", (-5.0 + 5.0 * i, rng.uniform(-2.0, 2.0), -rng.uniform(1.3, 2.5)), rng.uniform(-0.5, 0.5))
        for i in range(3)
    )
    return WatchedUrov(vehicle(), Pool(25.0, 12.5, 4.0, gates=gates), dive, Propulsion(8), seed)


def verdict(plant: WatchedUrov) -> Verdict | None:
    """Returns how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    found, misses = metrics(plant, 0), []
    if found["deepest_m"] < 1.0:
        misses.append("was never a metre deep")
    if found["end_depth_m"] > SURFACE_M:
        misses.append(f"ended {found['end_depth_m']:.2f} m deep, not at the surface")
    if plant.touched_n > HARD_N:
        misses.append(f"hit something with {plant.touched_n:.0f} N")
    return judged(misses)


def metrics(plant: WatchedUrov, seed: int) -> dict[str, Any]:
    """Returns where it went, and what it cost."""
    steps = zip(plant.course, plant.course[1:], strict=False)
    return {
        "deepest_m": max((sample.depth_m for sample in plant.course), default=0.0),
        "end_depth_m": plant.course[-1].depth_m if plant.course else 0.0,
        "way_m": sum(math.dist(a.position_m, b.position_m) for a, b in steps),
        "hardest_n": plant.touched_n,
        "energy_j": plant.thrusters.energy_j,
    }
