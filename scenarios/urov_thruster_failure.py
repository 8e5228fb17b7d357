"""One of eight thrusters fails while the vehicle goes ahead at 2 m. The vehicle gets no notice of it, only its errors.

The run succeeds if, from eight seconds after the failure on, it is within 20 cm of its depth and 12 degrees of its
heading. Every seed is another thruster; in half of them it is not dead but weak, or stuck at its last thrust.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.evaluation import TrackedUrov, hold_verdict
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants import Dive, Pool, Propulsion, Tether, ThrusterFault
from snr_sim.scenario import Verdict, rng_for, wrap_rad
from snr_sim.teleop import Cue

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
END_S = 32.0
TIME_LIMIT_S = END_S + 1.0

DEPTH_M = 2.0
ARM_S, AHEAD_S, FAILS_S, COPES_S = 2.0, 6.0, 12.0, 20.0
DEPTH_BAND_M, HEADING_BAND_DEG = 0.2, 12.0


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return what happens in the run of a seed."""
    rng = rng_for(seed, "dive")
    fault = ("off", "weak", "off", "stuck")[int(rng.integers(4))]
    return Dive(
        position_m=(-8.0, 0.0, -DEPTH_M),
        faults=(ThrusterFault(FAILS_S, int(rng.integers(8)), fault, effectiveness=float(rng.uniform(0.2, 0.6))),),
        tether=Tether(anchor_m=(-8.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's script."""
    script = (
        Cue(ARM_S, is_armed=True, mode="heading_hold", depth_m=DEPTH_M, heading_rad=0.0),
        Cue(AHEAD_S, surge=0.3),
    )
    return UrovParameters(vehicle(), script)


def plant(seed: int, engine: str) -> TrackedUrov:
    """Return the vehicle at its start."""
    return TrackedUrov(vehicle(), Pool(40.0, 40.0, 6.0), dive, Propulsion(8), seed)


def verdict(plant: TrackedUrov) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    found, misses = metrics(plant, 0), []
    if found["depth_error_m"] > DEPTH_BAND_M:
        misses.append(f"depth error was {found['depth_error_m']:.2f} m (limit {DEPTH_BAND_M:g} m)")
    if found["heading_error_deg"] > HEADING_BAND_DEG:
        misses.append(f"heading error was {found['heading_error_deg']:.1f} deg (limit {HEADING_BAND_DEG:g} deg)")
    return hold_verdict(plant, misses)


def metrics(plant: TrackedUrov, seed: int) -> dict[str, Any]:
    """Return how far off it was after it had time to cope, and at worst before."""
    worst, coped = plant.samples_between(FAILS_S, COPES_S), plant.samples_between(COPES_S, END_S)
    return {
        "fault": plant.dive.faults[0].fault,
        "thruster": plant.vehicle.thrusters[plant.dive.faults[0].thruster].name,
        "depth_error_m": max((abs(sample.depth_m - DEPTH_M) for sample in coped), default=None),
        "heading_error_deg": max((abs(math.degrees(wrap_rad(sample.yaw_rad))) for sample in coped), default=None),
        "worst_depth_error_m": max((abs(sample.depth_m - DEPTH_M) for sample in worst), default=None),
        "worst_heading_error_deg": max((abs(math.degrees(wrap_rad(sample.yaw_rad))) for sample in worst), default=None),
        "energy_j": plant.thrusters.energy_j,
    }
