"""Ends the surface's role when the vehicle's has finished. If the link is lost, it waits for the vehicle."""

from __future__ import annotations

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.prelude import tasks
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType


class LinkMonitorFactory(EndpointFactory):
    """Makes the monitor of the link whose status page has the key `link`."""

    def __init__(self, link: str) -> None:
        super().__init__()
        self.link: str = link

    def get(self, parent: NodeApi) -> LinkMonitor:
        """Return the endpoint 'link_monitor'."""
        return LinkMonitor(self, parent, "link_monitor")


class LinkMonitor(Endpoint):
    """Ends the surface's role after the vehicle's goodbye, which a vehicle that was cut off or killed does not send."""

    factory: LinkMonitorFactory

    def __init__(self, factory: LinkMonitorFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, factory.link): self.on_link}

    def on_link(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Check whether the vehicle has left."""
        link = self.get_data(self.factory.link)
        if not link["has_left"]:
            return None
        return tasks.terminate(f"the vehicle's role has finished: {link['reason'].rstrip('.')}")
