"""The surface's link is cut while the rover climbs: its wheels stop and hold it, and it is driven home when it is back.

It has saved itself if it stood 0.3 s after the cut (a command counts for 0.2 s), did not roll back by 0.3 m until the
link was back, and was then driven home astern. Every seed is another slope, another speed, another moment of the cut.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

from snr_sim_robot_rover.evaluation import BODIES, Tracked
from snr_sim_robot_rover.parameters import RoverParameters, vehicle
from snr_sim_robot_rover.sticks import curve

from snr_sim.plants import HeightMap, RoverStart
from snr_sim.scenario import Verdict, rng_for
from snr_sim.teleop import Cue

ROBOT = "rover"
ENGINES = ("mujoco", "pymunk")
CONTROLLER = "sticks"
TIME_LIMIT_S = 60.0

FIELD_M, SPACING_M = 60.0, 5.0
ARM_S, GO_S, CUT_FOR_S, BACK_AHEAD = 1.0, 2.0, 8.0, 0.6
STANDS_S, MAX_BACK_M, AT_REST_MPS, HOME_M, SAMPLE_S = 0.3, 0.3, 0.02, 1.0, 0.01


class Climb(NamedTuple):
    """What is different in each run."""

    slope_rad: float
    ahead: float  # of the stick
    cut_s: float


@lru_cache(maxsize=4)
def climb(seed: int) -> Climb:
    """Return what happens in the run of a seed."""
    rng = rng_for(seed, "climb")
    return Climb(math.radians(rng.uniform(5.0, 15.0)), rng.uniform(0.4, 0.7), rng.uniform(6.0, 8.0))


def parameters(seed: int) -> RoverParameters:
    """Return the parameters for the controller, and the pilot's script: up, and back astern when the link is back."""
    plain, (_, ahead, cut_s) = RoverParameters(), climb(seed)
    way_m = curve(ahead) * plain.limit_mps * (cut_s - GO_S)
    back_s = cut_s + CUT_FOR_S + 1.0
    script = (
        Cue(ARM_S, is_armed=True),
        Cue(GO_S, ahead=ahead),
        Cue(cut_s + 1.0, ahead=0.0),
        Cue(back_s, ahead=-BACK_AHEAD),
        Cue(back_s + way_m / (curve(BACK_AHEAD) * plain.limit_mps), ahead=0.0),
    )
    return RoverParameters(script=script, radio=replace(plain.radio, cut=((cut_s, cut_s + CUT_FOR_S),)))


def plant(seed: int, engine: str) -> Tracked:
    """Return the rover at its start, on the slope."""
    count = round(FIELD_M / SPACING_M) + 1
    corner_m = -0.5 * FIELD_M
    along = [(corner_m + SPACING_M * i) * math.tan(climb(seed).slope_rad) for i in range(count)]
    slope = HeightMap([along] * count, SPACING_M, (corner_m, corner_m))
    rover = BODIES[engine](vehicle(), slope, lambda seed: RoverStart(), seed=seed)
    rover.sample_s = SAMPLE_S
    return rover


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, or None while it drives."""
    cut_s, x_m = climb(plant.seed).cut_s, plant.read("pose").position_m[0]
    if plant.time_s < cut_s + CUT_FOR_S:
        return None
    found = metrics(plant, plant.seed)
    if found["rolled_s"] > STANDS_S:
        return Verdict("rolled on", False, f"it rolled for {found['rolled_s']:.2f} s (limit {STANDS_S:g} s)")
    if found["back_m"] > MAX_BACK_M:
        return Verdict("rolled back", False, f"it rolled back by {found['back_m']:.2f} m (limit {MAX_BACK_M:g} m)")
    is_home = plant.time_s > cut_s + CUT_FOR_S + 3.0 and plant.speed_mps < AT_REST_MPS and abs(x_m) < HOME_M
    return Verdict("home", True) if is_home else None


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return how long it rolled after the cut, how far it rolled back, and how far it had come."""
    cut_s = climb(seed).cut_s
    silent = [sample for sample in plant.course if cut_s <= sample.time_s <= cut_s + CUT_FOR_S]
    rolling = [sample.time_s for sample in silent if sample.speed_mps > AT_REST_MPS]
    ways_m = [sample.position_m[0] for sample in silent]
    return {
        "rolled_s": rolling[-1] - cut_s if rolling else 0.0,
        "back_m": max(ways_m) - ways_m[-1] if ways_m else 0.0,
        "way_m": max((sample.position_m[0] for sample in plant.course), default=0.0),
        "energy_j": plant.motors.battery.energy_j,
    }
