"""Lands as a learned table of action values says: `snr run lander_vertical --controller q --policy FILE`.

The table is one that `snr_sim.learning` has saved (robots/lander/learn.py makes one). It chooses, and learns no more.
"""

from __future__ import annotations

from snr_sim import Endpoint, EndpointFactory, Node, SomeTasks, Task, TaskId, TaskType
from snr_sim.learning.lander_envs import VERTICAL_THROTTLES, seen_by_radar
from snr_sim.learning.q_table import QTable
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.scenario import Robot
from snr_sim.prelude.signals import RadarReading

OPTIONS = {"policy": "file of the table, as QTable.save writes it"}
ENVIRONMENT = "snr_sim/LanderVertical-v0"


def factories(robot: Robot) -> list[EndpointFactory]:
    """Returns what makes the controller's components."""
    path = robot.options.get("policy")
    if path is None:
        raise ParameterError(
            "The controller 'q' needs a table to go by.",
            fix="--policy FILE; python robots/lander/learn.py --out policy.npz makes one in seconds.",
        )
    if robot.parameters.inertial is not None:
        raise ParameterError(
            f"The controller 'q' flies straight down, and {robot.scenario} is in the plane.",
            fix="snr run lander_vertical --controller q --policy FILE.",
        )
    return [QLearningControllerFactory(QTable.load(path, ENVIRONMENT))]


class QLearningControllerFactory(EndpointFactory):
    """Makes the pilot.

    Args:
        table: what it goes by.
    """

    def __init__(self, table: QTable) -> None:
        super().__init__()
        self.table = table

    def get(self, parent: Node) -> QLearningControllerEndpoint:
        """Returns a new one."""
        return QLearningControllerEndpoint(self, parent, "q_controller")


class QLearningControllerEndpoint(Endpoint):
    """Answers every radar reading with the throttle that is worth most there."""

    factory: QLearningControllerFactory

    def __init__(self, factory: QLearningControllerFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.table = factory.table
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Looks the reading up."""
        observation = seen_by_radar(RadarReading(**self.get_data("radar")))
        throttle = VERTICAL_THROTTLES[self.table.act(observation)]
        return self.store_data_task("engine", {"throttle": throttle}, process=False)
