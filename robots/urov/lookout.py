"""Who stays at the surface when the vehicle's role has finished: nobody. A vehicle that is lost is waited for."""

from __future__ import annotations

from snr_sim import Endpoint, EndpointFactory, SomeTasks, Task, TaskId, TaskType, tasks
from snr_sim.prelude.node_api import NodeApi


class LookoutFactory(EndpointFactory):
    """Makes the lookout.

    Args:
        link: the page that says how the link to the vehicle is.
    """

    def __init__(self, link: str) -> None:
        super().__init__()
        self.link = link

    def get(self, parent: NodeApi) -> Lookout:
        """Returns the endpoint 'lookout'."""
        return Lookout(self, parent, "lookout")


class Lookout(Endpoint):
    """Ends the surface's role when the vehicle's has said goodbye; one that was cut off or killed said nothing."""

    factory: LookoutFactory

    def __init__(self, factory: LookoutFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, factory.link): self.on_link}

    def on_link(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Looks whether the vehicle has left."""
        link = self.get_data(self.factory.link)
        if not link["left"]:
            return None
        return tasks.terminate(f"the vehicle's role has finished: {link['reason'].rstrip('.')}")
