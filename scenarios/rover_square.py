"""Around a square and back to the start, by wheels and gyroscope alone: no sensor measures where the rover is.

It must come within half a meter of each corner, in their order, and stop at the last one, which is the start. Every
seed is another square, to the left or to the right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from snr_sim_robot_rover.evaluation import BODIES, Mark, Tracked, nearest_m, way_m
from snr_sim_robot_rover.parameters import RoverParameters, vehicle

from snr_sim.plants import Coulomb, HeightMap, RoverStart
from snr_sim.scenario import Verdict, rng_for

ROBOT = "rover"
ROLES = ("rover",)
ENGINES = ("pymunk", "mujoco")
CONTROLLER = "dead_reckoning"
END_S = 90.0
TIME_LIMIT_S = END_S + 1.0

FIELD_M, SPACING_M = 40.0, 5.0
GRAVEL = Coulomb(0.6)
WITHIN_M, AT_REST_MPS, FAR_M = 0.5, 0.02, 12.0


@lru_cache(maxsize=4)
def corners(seed: int) -> tuple[tuple[float, float], ...]:
    """Return x and y of the corners of a seed; the last one is the start."""
    rng = rng_for(seed, "square")
    side_m, left = rng.uniform(4.0, 6.0), 1.0 if rng.random() < 0.5 else -1.0
    return (side_m, 0.0), (side_m, left * side_m), (0.0, left * side_m), (0.0, 0.0)


def parameters(seed: int) -> RoverParameters:
    """Return the parameters for the controller, with the corners."""
    return RoverParameters(points_m=corners(seed))


def plant(seed: int, engine: str) -> Tracked:
    """Return the rover at its start."""
    count = round(FIELD_M / SPACING_M) + 1
    level = HeightMap([[0.0] * count] * count, SPACING_M, (-0.5 * FIELD_M, -0.5 * FIELD_M))
    rover = BODIES[engine](vehicle(), level, lambda seed: RoverStart(), GRAVEL, seed=seed)
    rover.marks = [Mark(x, y, WITHIN_M) for x, y in corners(seed)]
    return rover


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, or None while it drives."""
    home_m = math.dist(plant.read("pose").position_m[:2], corners(plant.seed)[-1])
    if home_m > FAR_M:
        return Verdict("off course", False, f"it is {home_m:.1f} m from the start (limit {FAR_M:g} m)")
    is_home = home_m <= WITHIN_M
    is_over = plant.time_s >= END_S - 1e-6
    if not is_over and not (is_home and plant.speed_mps <= AT_REST_MPS):
        return None
    missed = missed_corners(nearest_m(plant.course, corners(plant.seed), WITHIN_M))
    if not missed and is_home:
        return Verdict("arrived", True)
    if not is_over:
        return None  # it is still at the start
    return Verdict("timeout", False, f"it missed corner {missed}" if missed else "it did not stop at the start")


def missed_corners(nearest: Sequence[float]) -> str:
    """Return which corners it was not near to, and by how much it missed them."""
    return ", ".join(f"{i + 1} by {gap:.2f} m" for i, gap in enumerate(nearest) if gap > WITHIN_M)


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return how near it came to each corner, how far and how long it drove, and what it took."""
    return {
        "nearest_m": nearest_m(plant.course, corners(seed), WITHIN_M),
        "way_m": way_m(plant.course),
        "time_s": plant.time_s,
        "energy_j": plant.motors.battery.energy_j,
    }
