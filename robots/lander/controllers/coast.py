"""Does nothing, and so shows what the ground is for: the module crashes. The smallest controller there is."""

from __future__ import annotations

from typing import Any

from snr_sim import Endpoint, EndpointFactory, SomeTasks, Task, TaskId, TaskType
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.scenario import Robot


def factories(robot: Robot) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [CoastFactory()]


class CoastFactory(EndpointFactory):
    """Factory of the pilot without commands."""

    def get(self, parent: NodeApi) -> Endpoint:
        """Return a new one."""
        return Coast(self, parent, "coast")


class Coast(Endpoint):
    """Answers every radar reading with the engine off."""

    def __init__(self, factory: CoastFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Leave the engine off."""
        command: dict[str, Any] = {"throttle": 0.0}
        return self.store_data_task("engine", command)
