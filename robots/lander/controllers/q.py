"""Lands by a learned policy: `snr run lander_vertical --controller q --policy FILE`, or lander_pad.

The file is one that `snr_sim.learning` has saved: a table for the vertical descent (robots/lander/learn.py makes one),
tiles for the plane (learn_pad.py). The controller chooses, and learns no more.
"""

from __future__ import annotations

from snr_sim import Endpoint, EndpointFactory, SomeTasks, Task, TaskId, TaskType
from snr_sim.learning.lander_envs import (
    VERTICAL_ACTIONS,
    VERTICAL_NAMES,
    VERTICAL_THROTTLES,
    pad_command,
    seen_by_radar,
    seen_in_the_plane,
)
from snr_sim.learning.pad_training import PadPolicy
from snr_sim.learning.q_table import QTable
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.scenario import Robot
from snr_sim.prelude.signals import InertialReading, RadarReading

OPTIONS = {"policy": "file of what was learned, as QTable.save or PadPolicy.save writes it"}
ENVIRONMENT = "snr_sim/LanderVertical-v0"


def factories(robot: Robot) -> list[EndpointFactory]:
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
            "The controller 'q' needs a file to go by.", fix=f"--policy FILE; python robots/lander/{maker}."
        )
    if is_in_plane:
        return [TilesControllerFactory(PadPolicy.load(path))]
    return [QLearningControllerFactory(QTable.load(path, ENVIRONMENT, VERTICAL_NAMES, VERTICAL_ACTIONS))]


class QLearningControllerFactory(EndpointFactory):
    """Factory of the pilot.

    Args:
        table: action values that it uses.
    """

    def __init__(self, table: QTable) -> None:
        super().__init__()
        self.table = table

    def get(self, parent: NodeApi) -> QLearningControllerEndpoint:
        """Return a new one."""
        return QLearningControllerEndpoint(self, parent, "q_controller")


class QLearningControllerEndpoint(Endpoint):
    """Answers every radar reading with the throttle that is worth most there."""

    factory: QLearningControllerFactory

    def __init__(self, factory: QLearningControllerFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.table = factory.table
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Return the throttle of the table for the newest reading."""
        observation = seen_by_radar(RadarReading(**self.get_data("radar")))
        throttle = VERTICAL_THROTTLES[self.table.act(observation)]
        return self.store_data_task("engine", {"throttle": throttle}, process=False)


class TilesControllerFactory(EndpointFactory):
    """Factory of the pilot in the plane.

    Args:
        policy: that it uses.
    """

    def __init__(self, policy: PadPolicy) -> None:
        super().__init__()
        self.policy = policy

    def get(self, parent: NodeApi) -> TilesControllerEndpoint:
        """Return a new one."""
        return TilesControllerEndpoint(self, parent, "q_controller")


class TilesControllerEndpoint(Endpoint):
    """Answers every inertial reading with throttle and jets; the radar's page of the same moment is there already."""

    factory: TilesControllerFactory

    def __init__(self, factory: TilesControllerFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.policy = factory.policy
        self.task_handlers = {(TaskType.process_data, "inertial"): self.on_inertial}

    def on_inertial(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Return the command of the policy for the newest readings."""
        radar = self.get_data("radar")
        if radar is None:
            return None
        seen = seen_in_the_plane(RadarReading(**radar), InertialReading(**self.get_data("inertial")))
        command = pad_command(self.policy.act(seen))
        engine = {"throttle": command.throttle, "gimbal_rad": command.gimbal_rad, "attitude": command.attitude}
        return self.store_data_task("engine", engine, process=False)
