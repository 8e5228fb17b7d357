"""Clear a yard with a Process_3D that needs 0.3 s for a picture: see housecat_clear.

All control processes change their state together, so a change takes as long as the slowest of them, and not longer.
"""

from __future__ import annotations

from snr_sim_robot_housecat.evaluation import END_S
from snr_sim_robot_housecat.evaluation import metrics as metrics
from snr_sim_robot_housecat.evaluation import parameters as parameters
from snr_sim_robot_housecat.evaluation import verdict as verdict
from snr_sim_robot_housecat.parameters import DOZER
from snr_sim_robot_housecat.yard import start

from snr_sim.plants import Dozer2D

ROBOT = "housecat"
ENGINES = ("pymunk",)
CONTROLLER = "slow_vision"
TIME_LIMIT_S = END_S + 1.0


def plant(seed: int, engine: str) -> Dozer2D:
    """Return the robot at its start."""
    return Dozer2D(DOZER, start, seed)
