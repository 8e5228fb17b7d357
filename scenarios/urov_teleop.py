"""Fly it yourself, for up to five minutes, with a game controller or the keyboard:

    snr run urov_teleop --speed real --option pilot=manual

or as on a real boat, each end in a process of its own, in two terminals:

    snr run urov_teleop --role urov
    snr run urov_teleop --role topside --option pilot=manual

    w s   ahead, astern     a d   left, right        1 2   arm, disarm       space   emergency stop
    i k   up, down          j l   turn left, right   - +   mode down, up     c       clear the stop

There are three gates. You have brought it home if it was a metre deep, is at the surface with its thrusters still, and
hit nothing with more than 50 N. Without you, a script goes down, there and back, and up again.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.evaluation import TrackedUrov, hold_verdict
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants import Current, Dive, Gate, Pool, Propulsion, Tether
from snr_sim.scenario import Verdict, ordered_sum, rng_for
from snr_sim.teleop import Cue

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
END_S = 300.0
TIME_LIMIT_S = END_S + 1.0

DEEP_M, SURFACE_M, STILL_N, HARD_N = 1.0, 0.4, 0.2, 50.0


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return where the run of a seed begins, and its current."""
    rng = rng_for(seed, "dive")
    current = Current(0.0, (rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), 0.0))
    return Dive(position_m=(-9.0, 0.0, -0.5), currents=(current,), tether=Tether(anchor_m=(-9.0, 0.0, 0.0)))


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's script for runs without a person."""
    script = (
        Cue(2.0, is_armed=True, mode="heading_hold", depth_m=1.5, heading_rad=0.0),
        Cue(9.0, surge=0.4),
        Cue(12.0, surge=0.0, heading_rad=math.pi),
        Cue(17.0, surge=0.4),
        Cue(20.0, surge=0.0, depth_m=0.1),
        Cue(29.0, is_armed=False),
    )
    return UrovParameters(vehicle(), script)


def plant(seed: int, engine: str) -> TrackedUrov:
    """Return the vehicle at its start."""
    rng = rng_for(seed, "gates")
    gates = tuple(
        Gate(f"gate_{i + 1}", (-5.0 + 5.0 * i, rng.uniform(-2.0, 2.0), -rng.uniform(1.3, 2.5)), rng.uniform(-0.5, 0.5))
        for i in range(3)
    )
    return TrackedUrov(vehicle(), Pool(25.0, 12.5, 4.0, gates=gates), dive, Propulsion(8), seed)


def verdict(plant: TrackedUrov) -> Verdict | None:
    """Return how it ended, or None while it dives."""
    is_over = plant.time_s >= END_S - 1e-6
    is_up = -plant.position_m[2] <= SURFACE_M
    is_still = max(map(abs, plant.thrusters.forces_n), default=0.0) < STILL_N
    if not (is_over or (is_up and is_still)):
        return None
    misses = []
    if _deepest_m(plant) < DEEP_M:
        if not is_over:
            return None  # it has not begun
        misses.append(f"maximum depth was {_deepest_m(plant):.2f} m (minimum {DEEP_M:g} m)")
    if not is_up:
        misses.append(f"final depth was {-plant.position_m[2]:.2f} m (limit {SURFACE_M:g} m)")
    if not is_still:
        misses.append("thrusters were still running at the end")
    if plant.max_contact_n > HARD_N:
        misses.append(f"hit an obstacle with {plant.max_contact_n:.0f} N (limit {HARD_N:g} N)")
    return hold_verdict(plant, misses)


def metrics(plant: TrackedUrov, seed: int) -> dict[str, Any]:
    """Return its path, and the cost."""
    steps = zip(plant.course, plant.course[1:], strict=False)
    return {
        "deepest_m": _deepest_m(plant),
        "end_depth_m": plant.course[-1].depth_m if plant.course else None,
        "way_m": ordered_sum(math.dist(a.position_m, b.position_m) for a, b in steps),
        "hardest_n": plant.max_contact_n,
        "energy_j": plant.thrusters.energy_j,
    }


def _deepest_m(plant: TrackedUrov) -> float:
    return max((sample.depth_m for sample in plant.course), default=0.0)
