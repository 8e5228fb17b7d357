"""A pilot's sticks and nothing else: down for four seconds, ahead for three, up for two.

Every seed is another start and another hand; the water is still. The vehicle has followed if it went down by a metre,
then ahead by 40 cm, then up by 40 cm, and if its thrusters were still before it was armed and after it was disarmed.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.evaluation import Sample, Tracked, TrackedUrov, hold_verdict
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants import Dive, Pool, Propulsion, Tether
from snr_sim.scenario import Verdict, rng_for
from snr_sim.teleop import Cue

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
END_S = 18.0
TIME_LIMIT_S = END_S + 1.0

ARM_S, DOWN_S, AHEAD_S, UP_S, DISARM_S = 2.0, 3.0, 8.0, 12.0, 16.0
DOWN_M, AHEAD_M, UP_M, STILL_N = 1.0, 0.4, 0.4, 0.2


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return where the run of a seed begins."""
    rng = rng_for(seed, "dive")
    return Dive(
        position_m=(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), -rng.uniform(0.8, 1.2)),
        attitude_rad=(0.0, 0.0, rng.uniform(-math.pi, math.pi)),
        tether=Tether(anchor_m=(0.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's script."""
    rng = rng_for(seed, "hands")
    script = (
        Cue(ARM_S, is_armed=True),
        Cue(DOWN_S, heave=-rng.uniform(0.55, 0.65)),
        Cue(DOWN_S + 4.0, heave=0.0),
        Cue(AHEAD_S, surge=rng.uniform(0.18, 0.2)),  # with more a vehicle without attitude control turns over
        Cue(AHEAD_S + 3.0, surge=0.0),
        Cue(UP_S, heave=rng.uniform(0.45, 0.55)),
        Cue(UP_S + 2.0, heave=0.0),
        Cue(DISARM_S, is_armed=False),
    )
    return UrovParameters(vehicle(), script)


def plant(seed: int, engine: str) -> TrackedUrov:
    """Return the vehicle at its start."""
    return TrackedUrov(vehicle(), Pool(40.0, 40.0, 8.0), dive, Propulsion(8), seed)


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    down_m, ahead_m, up_m = _moved(plant)
    misses = []
    if down_m < DOWN_M:
        misses.append(f"descended only {down_m:.2f} m of the required {DOWN_M:g} m")
    if ahead_m < AHEAD_M:
        misses.append(f"moved ahead only {ahead_m:.2f} m of the required {AHEAD_M:g} m")
    if up_m < UP_M:
        misses.append(f"ascended only {up_m:.2f} m of the required {UP_M:g} m")
    if _disarmed_thrust_n(plant) > STILL_N:
        misses.append(f"thrust was {_disarmed_thrust_n(plant):.1f} N while disarmed (limit {STILL_N:g} N)")
    return hold_verdict(plant, misses)


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return the distance in each direction, and the cost."""
    down_m, ahead_m, up_m = _moved(plant)
    return {
        "down_m": down_m,
        "ahead_m": ahead_m,
        "up_m": up_m,
        "disarmed_n": _disarmed_thrust_n(plant),
        "energy_j": plant.thrusters.energy_j,
    }


def _moved(plant: Tracked) -> tuple[float, float, float]:
    """Return how far it went down, ahead (by its own nose) and up, each in its time."""
    down, ahead, up = (plant.samples_between(from_s, from_s + 4.0) for from_s in (DOWN_S, AHEAD_S, UP_S))
    if not (down and ahead and up):
        return 0.0, 0.0, 0.0
    return (
        max(sample.depth_m for sample in down) - down[0].depth_m,
        max(_distance_ahead_m(ahead[0], sample) for sample in ahead),
        up[0].depth_m - min(sample.depth_m for sample in up),
    )


def _distance_ahead_m(before: Sample, after: Sample) -> float:
    x_m, y_m, _ = (b - a for a, b in zip(before.position_m, after.position_m, strict=True))
    return x_m * math.cos(before.yaw_rad) + y_m * math.sin(before.yaw_rad)


def _disarmed_thrust_n(plant: Tracked) -> float:
    samples = [*plant.samples_between(0.0, ARM_S), *plant.samples_between(DISARM_S + 1.0, END_S)]
    return max((sample.thrust_n for sample in samples), default=0.0)
