"""Interface of a node for its own parts. The node imports them, so they cannot import its class."""

from __future__ import annotations

from typing import Any, Protocol

from snr_sim.core.config import Config, Mode
from snr_sim.core.datastore import Datastore
from snr_sim.core.inbox import Inbox
from snr_sim.core.machine import EventMachine
from snr_sim.core.profiler import Profiler
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.prelude.node_api import NodeApi


class NodeParts(NodeApi, Protocol):
    """Interface of a node for its own parts, and for the code that runs and monitors nodes.

    Attributes:
        machine: executes its tasks.
        config: of the robot.
        profiler: times handlers, if there is one.
        thread_id: of the thread that executes its tasks.
        notes: for the end of the run.
    """

    machine: EventMachine
    config: Config
    mode: Mode
    profiler: Profiler | None
    thread_id: int

    @property
    def inbox(self) -> Inbox:
        """Inbox for inputs."""
        ...

    @property
    def datastore(self) -> Datastore:
        """Newest pages."""
        ...

    @property
    def notes(self) -> list[str]:
        """Remarks for the end of the run."""
        ...

    def begin(self) -> None:
        """Begin each component."""
        ...

    def run_ready(self) -> None:
        """Execute tasks until none is left or the node has ended."""
        ...

    def end(self, reason: str | None = None, error: Exception | None = None) -> None:
        """Finish what is queued, then halt and terminate each component."""
        ...

    def has_begun(self, component: Component) -> bool:
        """Return whether a component has begun and has not been terminated."""
        ...

    def note_terminated(self, reason: str) -> None:
        """Keep the reason of the first terminate task, and end the machine."""
        ...

    def record_failure(self, failure: ComponentFailedError) -> None:
        """Write a failure of this node into the trace, once."""
        ...

    def record_interrupt(self, component_name: str, message: str) -> None:
        """Write into the trace which handler was interrupted."""
        ...

    def summary(self) -> dict[str, Any]:
        """Return counts of the run."""
        ...
