"""Explore a room for five minutes: see 60 % of its floor, and hit nothing faster than 0.1 m/s.

Seed 0 is a room of 3.2 m by 2.4 m; every other seed is another size and another start.
"""

from __future__ import annotations

import math
from functools import lru_cache

from snr_sim_robot_dora.evaluation import END_S
from snr_sim_robot_dora.evaluation import metrics as metrics
from snr_sim_robot_dora.evaluation import parameters as parameters
from snr_sim_robot_dora.evaluation import verdict as verdict
from snr_sim_robot_dora.parameters import DORA

from snr_sim.plants import DiffDrive2D, DriveStart, Room
from snr_sim.scenario import rng_for

ROBOT = "dora"
ENGINES = ("pymunk",)
CONTROLLER = "explorer"
TIME_LIMIT_S = END_S + 1.0


@lru_cache(maxsize=4)
def start(seed: int) -> tuple[DriveStart, Room]:
    """Return where the run of a seed begins, and its room."""
    length, width, x, y, heading = 3.2, 2.4, 0.0, 0.0, 0.3
    if seed != 0:
        rng = rng_for(seed, "start")
        length, width = rng.uniform(2.6, 4.0), rng.uniform(2.0, 3.0)
        x, y = rng.uniform(-0.25, 0.25) * length, rng.uniform(-0.25, 0.25) * width
        heading = rng.uniform(-math.pi, math.pi)
    east, north = 0.5 * length, 0.5 * width
    return DriveStart((x, y), heading), Room(((-east, -north), (east, -north), (east, north), (-east, north)))


def plant(seed: int, engine: str) -> DiffDrive2D:
    """Return the robot at its start."""
    return DiffDrive2D(DORA, start, seed)
