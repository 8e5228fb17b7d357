"""Stopwatch: stores the time of each task with one of some ids."""

from __future__ import annotations

from collections.abc import Sequence

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, Task, TaskId


class StopwatchEndpointFactory(EndpointFactory):
    """Factory of an endpoint that appends the node's time [s] at each matching task to a list.

    The caller owns the list, so it is available after the run.
    """

    def __init__(self, times: list[float], ids: Sequence[TaskId], name: str = "stopwatch") -> None:
        super().__init__()
        self.times: list[float] = times
        self.ids: list[TaskId] = list(ids)
        self.name: str = name

    def get(self, parent: NodeApi) -> StopwatchEndpoint:
        """Return the endpoint."""
        return StopwatchEndpoint(self, parent, self.name)


class StopwatchEndpoint(Endpoint):
    """Stores the times of tasks."""

    factory: StopwatchEndpointFactory

    def __init__(self, factory: StopwatchEndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = dict.fromkeys(factory.ids, self.record_time)

    def record_time(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Append the time."""
        self.factory.times.append(self.get_time_s())
        return None
