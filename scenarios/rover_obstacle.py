"""To a goal 30 m away, among boulders, by a scan of the distances around and nothing else that sees.

The rover must stop within 2 m of the goal and touch nothing. Every seed is another field of boulders.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_rover.evaluation import BODIES, Mark, Tracked, way_m
from snr_sim_robot_rover.parameters import RoverParameters, vehicle

from snr_sim.plants import Coulomb, HeightMap, Ledge, RoverStart
from snr_sim.scenario import Verdict, rng_for

ROBOT = "rover"
ROLES = ("rover",)
ENGINES = ("mujoco", "pymunk")
CONTROLLER = "avoid"
TIME_LIMIT_S = 150.0

FIELD_M, SPACING_M = 100.0, 10.0
GRAVEL = Coulomb(0.6)
GOAL_M, WITHIN_M, AT_REST_MPS = (30.0, 0.0), 2.0, 0.02
BOULDERS, FROM_M, TO_M, SIDE_M, GAP_M = 14, 4.0, 27.0, 5.0, 2.4  # the rover is 0.9 m wide
SCAN_HZ = 5.0


@lru_cache(maxsize=4)
def boulders(seed: int) -> tuple[Ledge, ...]:
    """Return the boulders of a seed, with room for a rover between any two; the first is on the line to the goal."""
    rng = rng_for(seed, "boulders")
    found: list[Ledge] = []
    while len(found) < BOULDERS:
        y = rng.uniform(-SIDE_M, SIDE_M) if found else rng.uniform(-0.3, 0.3)
        half = (rng.uniform(0.2, 0.5), rng.uniform(0.2, 0.5), 0.5)
        one = Ledge((rng.uniform(FROM_M, TO_M), y, half[2]), half)
        if all(apart_m(one, other) > GAP_M for other in found):
            found.append(one)
    return tuple(found)


def apart_m(one: Ledge, other: Ledge) -> float:
    """Return the gap between two boulders."""
    gaps = (
        max(0.0, abs(a - b) - half_a - half_b)
        for a, b, half_a, half_b in zip(
            one.center_m[:2], other.center_m[:2], one.half_size_m, other.half_size_m, strict=False
        )
    )
    return math.hypot(*gaps)


def parameters(seed: int) -> RoverParameters:
    """Return the parameters for the controller."""
    return RoverParameters(scan_hz=SCAN_HZ, points_m=(GOAL_M,))


def plant(seed: int, engine: str) -> Tracked:
    """Return the rover at its start."""
    count = round(FIELD_M / SPACING_M) + 1
    level = HeightMap([[0.0] * count] * count, SPACING_M, (-0.5 * FIELD_M, -0.5 * FIELD_M))
    rover = BODIES[engine](vehicle(), level, lambda seed: RoverStart(), GRAVEL, boulders(seed), seed=seed)
    rover.marks = [Mark(*GOAL_M, WITHIN_M)]
    return rover


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, or None while it drives."""
    if plant.hit_n > 0.0:
        return Verdict("collided", False, f"it touched a boulder, with {plant.hit_n:.0f} N")
    is_there = math.dist(plant.read("pose").position_m[:2], GOAL_M) <= WITHIN_M
    return Verdict("arrived", True) if is_there and plant.speed_mps < AT_REST_MPS else None


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return how far and how long it drove, how far it ended from the goal, and what it took."""
    return {
        "left_m": math.dist(plant.read("pose").position_m[:2], GOAL_M),
        "way_m": way_m(plant.course),
        "time_s": plant.time_s,
        "hardest_n": plant.hit_n,
        "energy_j": plant.motors.battery.energy_j,
    }
