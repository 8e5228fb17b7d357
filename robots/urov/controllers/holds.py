"""The vehicle's standard controller: failsafe, holds, allocation, pulses. See `autopilot.py`."""

from __future__ import annotations

from snr_sim_robot_urov.autopilot import AutopilotFactory, Watch
from snr_sim_robot_urov.parameters import failsafe_lines

from snr_sim.core.config import AnyFactory
from snr_sim.scenario import RobotInfo


def factories(robot: RobotInfo) -> list[AnyFactory]:
    """Return what makes the controller's components, which run at the vehicle."""
    return [Watch.factory(), AutopilotFactory(robot.parameters)]


def start_lines(robot: RobotInfo) -> list[str]:
    """Return the table of failsafes, for the user who starts a run."""
    return failsafe_lines(robot.parameters)
