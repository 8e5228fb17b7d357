"""Water leaks in at 2.5 m: the vehicle detects it with its probe and surfaces by itself, though it grows heavier.

It has saved itself if it is at the surface 20 s after the leak began, and still there at the end, a litre heavier.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.evaluation import BODIES, Tracked, hold_verdict
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants import Dive, Leak, Pool, Propulsion, Tether
from snr_sim.scenario import Verdict, rng_for
from snr_sim.teleop import Cue

ROBOT = "urov"
ENGINES = ("mujoco", "pymunk")
CONTROLLER = "holds"
END_S = 45.0
TIME_LIMIT_S = END_S + 1.0

DEPTH_M = 2.5
ARM_S, LEAKS_S, UP_S = 2.0, 8.0, 20.0
SURFACE_M = 0.35


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return what happens in the run of a seed."""
    rng = rng_for(seed, "dive")
    leak = Leak(LEAKS_S, rate_lps=rng.uniform(0.02, 0.06), max_l=1.0, position_m=(rng.uniform(-0.05, 0.05), 0.0, -0.03))
    return Dive(position_m=(0.0, 0.0, -DEPTH_M), leak=leak, tether=Tether(anchor_m=(0.0, 0.0, 0.0)))


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's script: he ignores the leak's lamp."""
    return UrovParameters(vehicle(), (Cue(ARM_S, is_armed=True, mode="heading_hold", depth_m=DEPTH_M),))


def plant(seed: int, engine: str) -> Tracked:
    """Return the vehicle at its start."""
    return BODIES[engine](vehicle(), Pool(40.0, 40.0, 6.0), dive, Propulsion(8), seed)


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    found, misses = metrics(plant, 0), []
    if found["surfaced_s"] is None or found["surfaced_s"] > UP_S:
        misses.append(f"did not reach the surface within {UP_S:g} s of the leak")
    if found["end_depth_m"] > SURFACE_M:
        misses.append(f"final depth was {found['end_depth_m']:.2f} m (limit {SURFACE_M:g} m)")
    return hold_verdict(plant, misses)


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return when it was up, and whether it stayed."""
    up = [sample.time_s for sample in plant.samples_between(LEAKS_S, END_S) if sample.depth_m < SURFACE_M]
    return {
        "surfaced_s": up[0] - LEAKS_S if up else None,
        "end_depth_m": max((sample.depth_m for sample in plant.samples_between(END_S - 5.0, END_S)), default=None),
        "water_l": plant.read("leak").water_l,
        "energy_j": plant.thrusters.energy_j,
    }
