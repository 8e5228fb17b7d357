"""Fly it yourself, for up to five minutes, with a game controller or the keyboard:

    snr run urov_teleop --speed real --option pilot=hands

or as on a real boat, each end in a process of its own, in two terminals:

    snr run urov_teleop --role urov
    snr run urov_teleop --role topside --option pilot=hands

    w s   ahead, astern     a d   left, right        1 2   arm, disarm       space   emergency stop
    i k   up, down          j l   turn left, right   - +   mode down, up     c       clear the stop

There are three gates. You have brought it home if it was a metre deep, is at the surface with its thrusters still, and
hit nothing with more than 50 N. Without you, a script goes down, there and back, and up again.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.judging import WatchedUrov, judged
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants.urov.dive import Current, Dive
from snr_sim.plants.urov.pool import Gate, Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.tether import Tether
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.scenario import Verdict
from snr_sim.prelude.sums import ordered_sum
from snr_sim.teleop.scripted_pilot import Cue

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


def plant(seed: int, engine: str) -> WatchedUrov:
    """Return the vehicle at its start."""
    rng = rng_for(seed, "gates")
    gates = tuple(
        Gate(f"gate_{i + 1}", (-5.0 + 5.0 * i, rng.uniform(-2.0, 2.0), -rng.uniform(1.3, 2.5)), rng.uniform(-0.5, 0.5))
        for i in range(3)
    )
    return WatchedUrov(vehicle(), Pool(25.0, 12.5, 4.0, gates=gates), dive, Propulsion(8), seed)


def verdict(plant: WatchedUrov) -> Verdict | None:
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
        misses.append(f"was never {DEEP_M:g} m deep")
    if not is_up:
        misses.append(f"ended {-plant.position_m[2]:.2f} m deep, not at the surface")
    if not is_still:
        misses.append("its thrusters still turned at the end")
    if plant.touched_n > HARD_N:
        misses.append(f"hit something with {plant.touched_n:.0f} N")
    return judged(plant, misses)


def metrics(plant: WatchedUrov, seed: int) -> dict[str, Any]:
    """Return its path, and the cost."""
    steps = zip(plant.course, plant.course[1:], strict=False)
    return {
        "deepest_m": _deepest_m(plant),
        "end_depth_m": plant.course[-1].depth_m if plant.course else None,
        "way_m": ordered_sum(math.dist(a.position_m, b.position_m) for a, b in steps),
        "hardest_n": plant.touched_n,
        "energy_j": plant.thrusters.energy_j,
    }


def _deepest_m(plant: WatchedUrov) -> float:
    return max((sample.depth_m for sample in plant.course), default=0.0)
