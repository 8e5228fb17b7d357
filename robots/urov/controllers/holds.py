"""The vehicle's standard controller: guard, holds, allocation, pulses. See `autopilot.py`."""

from __future__ import annotations

from snr_sim_robot_urov.autopilot import AutopilotFactory

from snr_sim import EndpointFactory
from snr_sim.prelude.scenario import Robot


def factories(robot: Robot) -> list[EndpointFactory]:
    """Returns what makes the controller's components, which run at the vehicle."""
    return [AutopilotFactory(robot.parameters)]
