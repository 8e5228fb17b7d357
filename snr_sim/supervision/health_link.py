"""The page `health` over TCP: what serves it at a port, and a client that asks for it once."""

from __future__ import annotations

import os

import msgspec

from snr_sim.core.config import Config
from snr_sim.core.endpoint import Endpoint
from snr_sim.core.node import Node
from snr_sim.links.link import Link
from snr_sim.links.sockets import SocketsPair
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import LinkError, SnrError
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType, ensure_type_info
from snr_sim.std_mods.timing import TimeoutLoopFactory
from snr_sim.supervision.health import HEALTH, Health

MAX_BYTES = 1 << 20  # of a page: a thousand processes with their last lines


def health_link(address: tuple[str, int]) -> SocketsPair:
    """Return the link: its server sends the page and accepts none, its client accepts no other."""
    return SocketsPair(address, name=HEALTH, max_frame_bytes=MAX_BYTES, queue_pages=1)


class HealthReader(Endpoint):
    """Ends its node with the first page of health that arrives."""

    def begin(self) -> None:
        """Wait for a page."""
        self.found: Health | SnrError | None = None
        self.task_handlers = {(TaskType.process_data, HEALTH): self.on_page}

    def on_page(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Keep what the page says; it was written by any program."""
        assert task.page is not None
        try:
            self.found = msgspec.convert(task.page.data, ensure_type_info(Health))
        except msgspec.ValidationError as error:
            self.found = LinkError(
                f"The page that arrived does not say how processes are: {error}", fix="is that the right port?"
            )
        return tasks.terminate("a page has arrived")


def ask_health(address: tuple[str, int], wait_s: float) -> Health:
    """Return the page that is served at an address.

    Args:
        address: host and port.
        wait_s: how long to wait for it.

    Raises:
        LinkError: no page has arrived, or another one.
    """
    link = health_link(address)
    role = f"health_of_{os.getpid()}"
    factories = [HealthReader.factory(name="reader"), link.client(accept=[HEALTH]), TimeoutLoopFactory(wait_s)]
    node = Node(role, Config(factories={role: factories}))
    node.loop()
    reader, connection = node.components["reader"], node.components[f"link_{HEALTH}"]
    assert isinstance(reader, HealthReader)
    assert isinstance(connection, Link)
    if isinstance(reader.found, Health):
        return reader.found
    raise reader.found or LinkError(
        f"No health has arrived from {link.address} within {wait_s:g} s: {connection.reason or 'it sent none.'}",
        fix="check that the robot runs, and the port that it was started with: --health-at.",
    )
