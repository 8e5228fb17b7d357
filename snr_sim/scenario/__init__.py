"""Prepare, run and record a scenario, a program or a role, and what robots and scenarios are written with."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.prelude.angles import roll_pitch_yaw_rad as roll_pitch_yaw_rad
    from snr_sim.prelude.angles import wrap_rad as wrap_rad
    from snr_sim.prelude.component import Factory as Factory
    from snr_sim.prelude.node_api import NodeApi as NodeApi
    from snr_sim.prelude.recorder import RECORDING_KEY as RECORDING_KEY
    from snr_sim.prelude.rng import rng_for as rng_for
    from snr_sim.prelude.scenario import RobotContext as RobotContext
    from snr_sim.prelude.scenario import RobotInfo as RobotInfo
    from snr_sim.prelude.scenario import Verdict as Verdict
    from snr_sim.prelude.sums import ordered_sum as ordered_sum
    from snr_sim.prelude.wrench import AXES as AXES
    from snr_sim.scenario.library import load_program as load_program
    from snr_sim.scenario.machine_piece import replay_piece as replay_piece
    from snr_sim.scenario.simulation import Request as Request
    from snr_sim.scenario.simulation import prepare as prepare
    from snr_sim.scenario.simulation_run import RunResult as RunResult
    from snr_sim.scenario.simulation_run import SimulationRun as SimulationRun
    from snr_sim.scenario.simulation_run import run_recorded as run_recorded
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
