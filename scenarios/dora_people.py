"""Explore a room in which two people walk to and fro. They stop for a robot that is in front of them.

Five minutes; see 60 % of the floor, and hit nothing faster than 0.1 m/s. Every seed is another start and other ways.
"""

from __future__ import annotations

import math
from functools import lru_cache

from snr_sim_robot_dora.evaluation import END_S
from snr_sim_robot_dora.evaluation import metrics as metrics
from snr_sim_robot_dora.evaluation import parameters as parameters
from snr_sim_robot_dora.evaluation import verdict as verdict
from snr_sim_robot_dora.parameters import DORA

from snr_sim.plants import DiffDrive2D, DriveStart, Room, Walker
from snr_sim.scenario import rng_for

ROBOT = "dora"
ENGINES = ("pymunk",)
CONTROLLER = "weaver"
TIME_LIMIT_S = END_S + 1.0

EAST_M, NORTH_M = 2.0, 1.5


@lru_cache(maxsize=4)
def start(seed: int) -> tuple[DriveStart, Room]:
    """Return where the run of a seed begins, and its room."""
    rng = rng_for(seed, "start")
    walkers = tuple(
        Walker(
            (-EAST_M + 0.4, side * rng.uniform(0.7, 1.1)),
            (EAST_M - 0.4, side * rng.uniform(0.7, 1.1)),
            speed_mps=rng.uniform(0.2, 0.4),
        )
        for side in (-1.0, 1.0)
    )
    outline = ((-EAST_M, -NORTH_M), (EAST_M, -NORTH_M), (EAST_M, NORTH_M), (-EAST_M, NORTH_M))
    return DriveStart((0.0, 0.0), rng.uniform(-math.pi, math.pi)), Room(outline, walkers=walkers)


def plant(seed: int, engine: str) -> DiffDrive2D:
    """Return the robot at its start."""
    return DiffDrive2D(DORA, start, seed)
