"""Clears the yard although Process_3D takes 0.3 s for a picture: all change their state together, when it has ended."""

from __future__ import annotations

from snr_sim_robot_housecat.controllers import clearer

from snr_sim.scenario import Factory, RobotInfo


def factories(robot: RobotInfo) -> list[Factory]:
    """Return the components of `clearer`, with a slow Process_3D."""
    return clearer.factories(robot, ranging="slow")
