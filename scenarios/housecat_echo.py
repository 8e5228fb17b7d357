"""Two control processes follow a reference machine through its states for 64 s, while the vehicle stands.

An event every four seconds, sixteen in all. `snr trace RUN` shows that both begin and end each state together.
"""

from __future__ import annotations

from typing import Any

from snr_sim_robot_housecat.evaluation import parameters as parameters
from snr_sim_robot_housecat.parameters import DOZER
from snr_sim_robot_housecat.yard import start

from snr_sim.plants import Dozer2D
from snr_sim.scenario import Verdict

ROBOT = "housecat"
ENGINES = ("pymunk",)
CONTROLLER = "echo"
END_S = 66.0
TIME_LIMIT_S = END_S + 1.0
MAX_WAY_M = 0.001


def plant(seed: int, engine: str) -> Dozer2D:
    """Return the robot at its start."""
    return Dozer2D(DOZER, start, seed)


def verdict(plant: Dozer2D) -> Verdict | None:
    """Return how it ended, or None while it runs."""
    if plant.way_m > MAX_WAY_M:
        return Verdict("moved", False, f"it moved by {plant.way_m:.3f} m (limit {MAX_WAY_M:g} m)")
    return Verdict("completed", True) if plant.time_s >= END_S - 1e-6 else None


def metrics(plant: Dozer2D, seed: int) -> dict[str, Any]:
    """Return how long it took."""
    return {"time_s": plant.time_s}
