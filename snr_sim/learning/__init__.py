"""Scenarios as gymnasium environments, and tabular learning. Importing this registers the environments."""

import sys
from importlib import import_module
from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.learning.batch_training import BatchTraining as BatchTraining
    from snr_sim.learning.batch_training import EvaluationResult as EvaluationResult
    from snr_sim.learning.batch_training import VerticalBatchTask as VerticalBatchTask
    from snr_sim.learning.batch_training import coarse_grid as coarse_grid
    from snr_sim.learning.batch_training import new_table as new_table
    from snr_sim.learning.batch_training import train_vertical as train_vertical
    from snr_sim.learning.batch_training import vertical_batch_task as vertical_batch_task
    from snr_sim.learning.discretiser import Discretiser as Discretiser
    from snr_sim.learning.lander_envs import VERTICAL_ACTIONS as VERTICAL_ACTIONS
    from snr_sim.learning.lander_envs import VERTICAL_NAMES as VERTICAL_NAMES
    from snr_sim.learning.lander_envs import VERTICAL_THROTTLES as VERTICAL_THROTTLES
    from snr_sim.learning.lander_envs import pad_command as pad_command
    from snr_sim.learning.lander_envs import pad_observation as pad_observation
    from snr_sim.learning.lander_envs import radar_observation as radar_observation
    from snr_sim.learning.lander_envs import reference_speed_mps as reference_speed_mps
    from snr_sim.learning.pad_training import PadPolicy as PadPolicy
    from snr_sim.learning.pad_training import PadTraining as PadTraining
    from snr_sim.learning.pad_training import train_pad as train_pad
    from snr_sim.learning.q_table import QTable as QTable
    from snr_sim.learning.scenario_env import ScenarioEnv as ScenarioEnv
    from snr_sim.learning.tabular import METHODS as METHODS
    from snr_sim.learning.tabular import ExponentialSchedule as ExponentialSchedule
    from snr_sim.learning.tabular import Training as Training
    from snr_sim.learning.tabular import evaluate as evaluate
    from snr_sim.learning.tabular import train as train
    from snr_sim.learning.tile_coding import TileCoder as TileCoder
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)

# gymnasium takes a second to import, and is not in the base install: without it there is nothing to register.
if "gymnasium" in sys.modules:
    import_module("snr_sim.learning.gym")
else:
    from snr_sim.learning.late_registration import register_later

    register_later()
