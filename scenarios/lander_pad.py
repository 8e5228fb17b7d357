"""A lunar module in the plane, above gentle hills: fly to the pad, stand upright, touch down softly.

Every seed is another start: height, distance, speed, tilt, mass and hills. It has landed when it is at rest on both
feet, tilted by at most 12 degrees, and the first contact was within what the gear takes, on the pad or off it. No wind
(there is no air), and nothing breaks. With `--engine mujoco` the same module is free in all six directions and stands
on four legs.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_lander.evaluation import judge, plane_metrics
from snr_sim_robot_lander.parameters import APOLLO, DRY_MASS_KG, INERTIAL, PLANE_RADAR, LanderParameters

from snr_sim.plants import Lander, Lander2D, Lander3D, PlaneStart, Terrain, make_terrain
from snr_sim.scenario import Verdict, rng_for

ROBOT = "lander"
BODIES = {"pymunk": Lander2D, "mujoco": Lander3D}  # in the plane on two legs; in space on four
ENGINES = ("pymunk", "mujoco")  # for --engine; the first is the default
CONTROLLER = "pad"
TIME_LIMIT_S = 180.0


@lru_cache(maxsize=4)
def start(seed: int) -> tuple[PlaneStart, Terrain]:
    """Return where the run of a seed begins, and the ground it has."""
    rng = rng_for(seed, "start")
    fuel = rng.uniform(500.0, 700.0)
    begin = PlaneStart(
        position_m=(rng.uniform(-60.0, 60.0), rng.uniform(120.0, 180.0)),
        velocity_mps=(rng.uniform(-6.0, 6.0), rng.uniform(-8.0, -2.0)),
        attitude_rad=math.radians(rng.uniform(-6.0, 6.0)),
        rate_radps=math.radians(rng.uniform(-1.0, 1.0)),
        mass_kg=DRY_MASS_KG + fuel,
        fuel_kg=fuel,
    )
    return begin, make_terrain(seed, relief_m=5.0)


def parameters(seed: int) -> LanderParameters:
    """Return the parameters for the controller."""
    begin, _ = start(seed)
    return LanderParameters(begin.mass_kg, begin.fuel_kg, APOLLO, PLANE_RADAR, INERTIAL, engine_hz=10.0)


def plant(seed: int, engine: str) -> Lander:
    """Return the module at its start."""
    return BODIES[engine](APOLLO, start, seed)


def verdict(plant: Lander) -> Verdict | None:
    """Return how it ended, or None while it flies."""
    return judge(plant)


def metrics(plant: Lander, seed: int) -> dict[str, Any]:
    """Return the touchdown, and the propellant relative to a lower bound: the best vertical descent from this start."""
    return plane_metrics(plant, *start(seed))
