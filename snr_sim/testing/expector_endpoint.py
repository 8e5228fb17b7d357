"""Endpoint in the node under test that passes each expected task to an expector."""

from __future__ import annotations

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.handlers import check_id
from snr_sim.prelude import tasks
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType
from snr_sim.testing.expector import Expectations

SATISFIED = "expector satisfied"


class ExpectorEndpointFactory(EndpointFactory):
    """Factory of an endpoint that puts an expector into a node.

    Args:
        expector: receives the tasks.
        name: of the endpoint.
        exit_when_satisfied: ends the node as soon as all expected tasks have come; later ones are not counted.

    Raises:
        ConfigError: the expector expects something that is not a task.
    """

    def __init__(self, expector: Expectations, name: str = "expector", exit_when_satisfied: bool = False) -> None:
        super().__init__()
        for task_id in expector.ids:
            check_id("expector", task_id)  # raises for a text: `call` counts those, which the test calls itself
        self.expector = expector
        self.name = name
        self.exit_when_satisfied = exit_when_satisfied

    def get(self, parent: NodeApi) -> ExpectorEndpoint:
        """Return the endpoint."""
        return ExpectorEndpoint(self, parent, self.name)


class ExpectorEndpoint(Endpoint):
    """Endpoint with handlers for the expected tasks only, so that the run's own notes do not change."""

    factory: ExpectorEndpointFactory

    def __init__(self, factory: ExpectorEndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self._is_done = False
        self.task_handlers = dict.fromkeys(factory.expector.ids, self.on_task)

    def begin(self) -> None:
        """Mark the expector as used in a node that runs."""
        self.factory.expector.was_used = True

    def on_task(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Pass the task to the expector."""
        if self._is_done:
            return None
        expector = self.factory.expector
        expector.on_task(task)
        if self.factory.exit_when_satisfied and expector.is_satisfied():
            self._is_done = True
            return tasks.terminate(SATISFIED)
        return None

    def terminate(self) -> None:
        """Pass the names of the tasks seen in this node to the expector."""
        for kind, names in self.parent.seen_tasks().items():
            # The names of terminate tasks are free reasons, so a similar one is not a typing error.
            if kind is not TaskType.terminate:
                self.factory.expector.add_other_tasks(kind, names)
