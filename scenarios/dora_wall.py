"""Drive at a wall, and stop 40 cm before it: what remains shows how late the readings and the commands were.

Every seed is another distance at the start, so that readings fall into another moment of the approach. Success is to
stop without touching the wall.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from snr_sim_robot_dora.parameters import DORA, DoraParameters

from snr_sim.plants import WALL_RADIUS_M, DiffDrive2D, DriveStart, Room
from snr_sim.scenario import Verdict, rng_for

ROBOT = "dora"
ENGINES = ("pymunk",)
CONTROLLER = "stop"
TIME_LIMIT_S = 60.0

START_M, SPREAD_M = 1.2, 0.4  # from the front to the wall
NEAR_M = 0.4  # where the program is to stop


@lru_cache(maxsize=4)
def start(seed: int) -> tuple[DriveStart, Room]:
    """Return where the run of a seed begins; the wall is at x = 0."""
    distance = START_M + (rng_for(seed, "start").uniform(0.0, SPREAD_M) if seed != 0 else 0.0)
    east = WALL_RADIUS_M
    room = Room(((-3.0, -1.0), (east, -1.0), (east, 1.0), (-3.0, 1.0)))
    return DriveStart((-distance - 0.5 * DORA.size_m[0], 0.0)), room


def parameters(seed: int) -> DoraParameters:
    """Return the parameters for the controller."""
    return DoraParameters()


def plant(seed: int, engine: str) -> DiffDrive2D:
    """Return the robot at its start."""
    return DiffDrive2D(DORA, start, seed)


def verdict(plant: DiffDrive2D) -> Verdict | None:
    """Return how it ended: touching the wall, or at rest before it."""
    if plant.hit_mps > 0.0:
        return Verdict("collided", False, f"it met the wall at {plant.hit_mps:.2f} m/s")
    has_stopped = plant.way_m > 0.1 and plant.goals_mps == plant.treads_mps == (0.0, 0.0)
    return Verdict("stopped", True) if has_stopped else None


def metrics(plant: DiffDrive2D, seed: int) -> dict[str, Any]:
    """Return how far it is from the wall, and how far it was driven after it should have stopped.

    The second is without the way in which the motors run down, which is their lag times the speed.
    """
    left_m = -plant.position_m[0] - 0.5 * DORA.size_m[0]
    return {"left_m": left_m, "beyond_m": NEAR_M - left_m, "hit_mps": plant.hit_mps}
