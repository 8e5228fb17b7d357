"""Lands by a learned policy: `snr run lander_vertical --controller q --policy FILE`, or lander_pad.

The file is one that `snr_sim.learning` has saved: a table for the vertical descent (robots/lander/learn.py makes one),
tiles for the plane (learn_pad.py). The controller chooses, and learns no more.
"""

from __future__ import annotations

from typing import Any

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.errors import ParameterError
from snr_sim.learning import (
    VERTICAL_ACTIONS,
    VERTICAL_NAMES,
    VERTICAL_THROTTLES,
    PadPolicy,
    QTable,
    pad_command,
    pad_observation,
    radar_observation,
)
from snr_sim.scenario import RobotInfo
from snr_sim.signals import InertialReading, RadarReading

OPTIONS = {"policy": "file of what was learned, as QTable.save or PadPolicy.save writes it"}
ENVIRONMENT = "snr_sim/LanderVertical-v0"


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    is_in_plane = robot.parameters.inertial is not None
    path = robot.options.get("policy")
    if path is None:
        maker = (
            "learn_pad.py --out policy.npz makes one in two minutes"
            if is_in_plane
            else ("learn.py --out policy.npz makes one in seconds")
        )
        raise ParameterError(
            "Controller 'q' requires --policy.", fix=f"pass --policy FILE; python robots/lander/{maker}."
        )
    if is_in_plane:
        return [TilesControllerEndpoint.factory("q_controller", policy=PadPolicy.load(path))]
    table = QTable.load(path, ENVIRONMENT, VERTICAL_NAMES, VERTICAL_ACTIONS)
    return [QLearningControllerEndpoint.factory("q_controller", table=table)]


class QLearningControllerEndpoint(Endpoint):
    """Answers every radar reading with the throttle that is worth most there."""

    table: QTable

    @handles("radar")
    def on_radar(self, radar: dict[str, Any]) -> SomeTasks:
        """Return the throttle of the table for the newest reading."""
        observation = radar_observation(RadarReading(**radar))
        throttle = VERTICAL_THROTTLES[self.table.act(observation)]
        return self.store_data_task("engine", {"throttle": throttle}, process=False)


class TilesControllerEndpoint(Endpoint):
    """Answers every inertial reading with throttle and jets; the radar's page of the same moment is there already."""

    policy: PadPolicy

    @handles("inertial")
    def on_inertial(self, inertial: dict[str, Any]) -> SomeTasks:
        """Return the command of the policy for the newest readings."""
        radar = self.get_data("radar")
        if radar is None:
            return None
        seen = pad_observation(RadarReading(**radar), InertialReading(**inertial))
        command = pad_command(self.policy.act(seen))
        engine = {"throttle": command.throttle, "gimbal_rad": command.gimbal_rad, "attitude": command.attitude}
        return self.store_data_task("engine", engine, process=False)
