"""Interface of a node for its own parts. The node imports them, so they cannot import its class."""

from __future__ import annotations

from typing import Protocol

from snr_sim.core.config import Config, Mode
from snr_sim.core.datastore import Datastore
from snr_sim.core.inbox import Inbox
from snr_sim.core.machine import EventMachine
from snr_sim.core.node_report import NodeReport
from snr_sim.core.profiler import Profiler
from snr_sim.prelude.component import Component
from snr_sim.prelude.node_api import NodeApi


class NodeParts(NodeApi, Protocol):
    """Interface of a node for its own parts, and for the code that runs and monitors nodes.

    Attributes:
        machine: executes its tasks.
        report: its notes and failures.
        config: of the robot.
        profiler: times handlers, if there is one.
        thread_id: of the thread that executes its tasks.
    """

    machine: EventMachine
    report: NodeReport
    config: Config
    mode: Mode
    profiler: Profiler | None
    thread_id: int
    inbox: Inbox
    datastore: Datastore

    def begin(self) -> None:
        """Begin each component."""

    def run_ready(self) -> None:
        """Execute tasks until none is left or the node has ended."""

    def end(self, reason: str | None = None, error: Exception | None = None) -> None:
        """Finish what is queued, then halt and terminate each component."""

    def has_begun(self, component: Component) -> bool:
        """Return whether a component has begun and has not been terminated."""
