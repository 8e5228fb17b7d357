"""The tether's link is cut while the pilot is going ahead: nothing pushes, then the vehicle stays, then it comes up.

It has saved itself if no thruster pushed half a second after the cut, if it kept its depth within 30 cm until its
patience was over, and if it is at the surface at the end, having touched nothing.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.evaluation import BODIES, Tracked, hold_verdict
from snr_sim_robot_urov.failsafe_monitor import FailsafeLimits
from snr_sim_robot_urov.parameters import UrovParameters, vehicle
from snr_sim_robot_urov.tether_link import tether_faults

from snr_sim.plants import Dive, Pool, Propulsion, Tether
from snr_sim.scenario import Verdict, rng_for
from snr_sim.teleop import Cue

ROBOT = "urov"
ENGINES = ("mujoco", "pymunk")
CONTROLLER = "holds"
END_S = 36.0
TIME_LIMIT_S = END_S + 1.0

LIMITS = FailsafeLimits(hold_s=6.0)
ARM_S, AHEAD_S, CUT_S = 2.0, 6.0, 10.0
NEUTRAL_S, NEUTRAL_N, DEPTH_BAND_M, SURFACE_M = 0.5, 0.5, 0.3, 0.35


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return what happens in the run of a seed."""
    rng = rng_for(seed, "dive")
    return Dive(
        position_m=(0.0, 0.0, -rng.uniform(1.5, 2.5)),
        attitude_rad=(0.0, 0.0, rng.uniform(-math.pi, math.pi)),
        tether=Tether(anchor_m=(0.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's script."""
    script = (Cue(ARM_S, is_armed=True, mode="heading_hold"), Cue(AHEAD_S, surge=0.5))
    link = replace(tether_faults(35.0), cut=((CUT_S, math.inf),))
    return UrovParameters(vehicle(), script, failsafe_limits=LIMITS, tether=link)


def plant(seed: int, engine: str) -> Tracked:
    """Return the vehicle at its start."""
    return BODIES[engine](vehicle(), Pool(40.0, 40.0, 6.0), dive, Propulsion(8), seed)


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    found, misses = metrics(plant, 0), []
    if found["thrust_after_cut_n"] > NEUTRAL_N:
        misses.append(
            f"thrust was {found['thrust_after_cut_n']:.1f} N {NEUTRAL_S:g} s after the cut (limit {NEUTRAL_N:g} N)"
        )
    if found["depth_error_m"] > DEPTH_BAND_M:
        misses.append(f"depth error was {found['depth_error_m']:.2f} m (limit {DEPTH_BAND_M:g} m)")
    if found["end_depth_m"] > SURFACE_M:
        misses.append(f"final depth was {found['end_depth_m']:.2f} m (limit {SURFACE_M:g} m)")
    if plant.max_contact_n > 0.0:
        misses.append(f"touched an obstacle with {plant.max_contact_n:.0f} N")
    return hold_verdict(plant, misses)


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return measures of its motion after the cut."""
    neutral = plant.samples_between(CUT_S + NEUTRAL_S, CUT_S + LIMITS.lost_s - 0.2)
    at_cut = plant.samples_between(CUT_S, CUT_S + 0.05)
    held = plant.samples_between(CUT_S, CUT_S + LIMITS.lost_s + LIMITS.hold_s)
    risen = [sample.time_s for sample in plant.samples_between(CUT_S, END_S) if sample.depth_m < SURFACE_M]
    return {
        "thrust_after_cut_n": max((sample.thrust_n for sample in neutral), default=None),
        "depth_error_m": max((abs(sample.depth_m - at_cut[0].depth_m) for sample in held), default=None),
        "surfaced_s": risen[0] - CUT_S if risen else None,
        "end_depth_m": plant.course[-1].depth_m if plant.course else None,
        "energy_j": plant.thrusters.energy_j,
    }
