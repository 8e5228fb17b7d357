"""The ear of an expector: an endpoint in the node under test that tells it of each task it waits for."""

from __future__ import annotations

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.handlers import check_id
from snr_sim.prelude import tasks
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType
from snr_sim.testing.expector import Expectations

SATISFIED = "expector satisfied"


class ExpectorEndpointFactory(EndpointFactory):
    """Puts an expector into a node.

    Args:
        expector: is told of tasks.
        name: of the endpoint.
        exit_when_satisfied: ends the node as soon as all that is expected has come; what comes later is not heard.

    Raises:
        ConfigError: the expector waits for something that is no task.
    """

    def __init__(self, expector: Expectations, name: str = "expector", exit_when_satisfied: bool = False) -> None:
        super().__init__()
        for task_id in expector.ids:
            check_id("expector", task_id)  # a text is no task: `call` counts it, wherever the test calls that
        self.expector = expector
        self.name = name
        self.exit_when_satisfied = exit_when_satisfied

    def get(self, parent: NodeApi) -> ExpectorEndpoint:
        """Return the endpoint."""
        return ExpectorEndpoint(self, parent, self.name)


class ExpectorEndpoint(Endpoint):
    """Handles what the expector expects, and nothing else, so that the run's own notes stay as they are."""

    factory: ExpectorEndpointFactory

    def __init__(self, factory: ExpectorEndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self._is_done = False
        self.task_handlers = dict.fromkeys(factory.expector.ids, self.hear)

    def begin(self) -> None:
        """Tell the expector that it is in a node that runs."""
        self.factory.expector.was_used = True

    def hear(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Tell the expector."""
        if self._is_done:
            return None
        expector = self.factory.expector
        expector.hear(task)
        if self.factory.exit_when_satisfied and expector.is_satisfied():
            self._is_done = True
            return tasks.terminate(SATISFIED)
        return None

    def terminate(self) -> None:
        """Tell the expector which names came by in this node."""
        for kind, names in self.parent.seen_tasks().items():
            # A reason to end is nobody's typing error.
            if kind is not TaskType.terminate:
                self.factory.expector.add_seen(kind, names)
