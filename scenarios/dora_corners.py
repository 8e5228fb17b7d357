"""Explore a room with narrow corners, in which a robot that always turns the same way stays caught.

Five minutes; see 60 % of the floor, and hit nothing faster than 0.1 m/s. Every seed but 0 is another start.
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
CONTROLLER = "weaver"
TIME_LIMIT_S = END_S + 1.0

# Two wedges at the ends of a hall, and a cupboard that makes a dead end with the wall.
ROOM = Room(
    outline_m=((-1.2, -1.0), (1.2, -1.0), (2.4, 0.1), (1.2, 1.0), (-1.2, 1.0), (-2.4, -0.1)),
    furniture_m=(((0.2, 0.35), (0.9, 0.35), (0.9, 0.55), (0.2, 0.55)),),
)


@lru_cache(maxsize=4)
def start(seed: int) -> tuple[DriveStart, Room]:
    """Return where the run of a seed begins: facing a wedge, in seed 0 the eastern one."""
    x, y, heading = 0.9, 0.0, 0.05
    if seed != 0:
        rng = rng_for(seed, "start")
        x, y = rng.uniform(-0.9, 0.9), rng.uniform(-0.6, 0.1)
        heading = rng.choice((0.0, math.pi)) + rng.uniform(-0.3, 0.3)
    return DriveStart((x, y), heading), ROOM


def plant(seed: int, engine: str) -> DiffDrive2D:
    """Return the robot at its start."""
    return DiffDrive2D(DORA, start, seed)
