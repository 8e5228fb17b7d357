"""Drive through dry sand that rises, up a slope of 15 degrees, and stop there: six wheels, soft and firm ground.

8 m of sand rise by 5 degrees, where half of each turn of a wheel is slip; then come a level stretch and the slope. The
rover must stop on the slope, and not slide back by more than 0.3 m in ten seconds. Every seed is another length of both
and another start.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from snr_sim_robot_rover.evaluation import BODIES, Sample, Tracked, way_m
from snr_sim_robot_rover.parameters import RoverParameters, vehicle

from snr_sim.plants import DRY_SAND, Coulomb, Ground, HeightMap, RoverStart
from snr_sim.scenario import Verdict, rng_for

ROBOT = "rover"
ROLES = ("rover",)
ENGINES = ("mujoco", "pymunk")
CONTROLLER = "climb"
TIME_LIMIT_S = 90.0

SAND_RAD, SLOPE_RAD = math.radians(5.0), math.radians(15.0)
FRICTION = 0.8
STANDS_S, MAX_BACK_M = 10.0, 0.3
AT_REST_MPS = 0.02
MAX_OFF_M = 3.0  # to the side
SPACING_M, HALF_WIDTH_M, LENGTH_M = 0.5, 8.0, 45.0


@lru_cache(maxsize=4)
def ground(seed: int) -> tuple[HeightMap, tuple[float, float, float]]:
    """Return the ground of a seed, where the sand begins and ends, and where the slope begins [m]."""
    sand_m, gap_m = 8.0, 3.0
    if seed != 0:
        rng = rng_for(seed, "ground")
        sand_m, gap_m = rng.uniform(6.0, 9.0), rng.uniform(2.0, 4.0)
    begin, end = 3.0, 3.0 + sand_m
    slope_m = end + gap_m

    def height(x: float) -> float:
        in_sand = min(max(x - begin, 0.0), sand_m)
        return in_sand * math.tan(SAND_RAD) + max(x - slope_m, 0.0) * math.tan(SLOPE_RAD)

    along = [-5.0 + SPACING_M * i for i in range(round((LENGTH_M + 5.0) / SPACING_M) + 1)]
    count = round(2.0 * HALF_WIDTH_M / SPACING_M) + 1
    return HeightMap([[height(x) for x in along]] * count, SPACING_M, (-5.0, -HALF_WIDTH_M)), (begin, end, slope_m)


@lru_cache(maxsize=4)
def start(seed: int) -> RoverStart:
    """Return where the run of a seed begins."""
    return RoverStart() if seed == 0 else RoverStart((0.0, rng_for(seed, "start").uniform(-0.5, 0.5)))


def soil(seed: int) -> Callable[[float, float], Ground]:
    """Return what the ground of a seed is made of."""
    begin, end, _ = ground(seed)[1]
    firm = Coulomb(FRICTION)
    return lambda x_m, y_m: DRY_SAND if begin < x_m < end else firm


def parameters(seed: int) -> RoverParameters:
    """Return the parameters for the controller."""
    return RoverParameters()


def plant(seed: int, engine: str) -> Tracked:
    """Return the rover at its start."""
    return BODIES[engine](vehicle(), ground(seed)[0], start, soil(seed), seed=seed)


def stand(plant: Tracked) -> list[Sample]:
    """Return the samples since it came to rest on the slope; none if it has not."""
    *_, slope_m = ground(plant.seed)[1]
    for i, sample in enumerate(plant.course):
        if sample.position_m[0] > slope_m + 0.5 and sample.speed_mps < AT_REST_MPS:
            return plant.course[i:]
    return []


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, or None while it drives."""
    if plant.has_tipped_over:
        return Verdict("tipped over", False, "the rover lies on its side")
    if abs(plant.course[-1].position_m[1] if plant.course else 0.0) > MAX_OFF_M:
        return Verdict("off course", False, f"it is {MAX_OFF_M:g} m to the side of its way")
    stood = stand(plant)
    if not stood or plant.time_s < stood[0].time_s + STANDS_S:
        return None
    back_m = max(sample.position_m[0] for sample in stood) - stood[-1].position_m[0]
    if back_m > MAX_BACK_M:
        return Verdict("slid back", False, f"it slid back by {back_m:.2f} m (limit {MAX_BACK_M:g} m)")
    return Verdict("stands", True)


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return how far and how long it drove, and what it took."""
    stood = stand(plant)
    return {
        "way_m": way_m(plant.course),
        "stands_since_s": stood[0].time_s if stood else None,
        "back_m": max(s.position_m[0] for s in stood) - stood[-1].position_m[0] if stood else None,
        "energy_j": plant.motors.battery.energy_j,
    }
