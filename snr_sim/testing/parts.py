"""Components made of plain functions: the environment of a component under test, in one line each.

PartFactory({(TaskType.event, "start"): lambda task, task_id: tasks.terminate("done")})
TickerFactory(lambda loop: loop.store_data("depth", 1.5), rate_hz=10)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import TaskHandler, TaskId

PartStep: TypeAlias = Callable[["Part"], Any]
TickerStep: TypeAlias = Callable[["Ticker"], Any]


def nothing(component: object) -> None:
    """Do nothing."""


class PartFactory(EndpointFactory):
    """Makes an endpoint of functions.

    Args:
        handlers: functions of (task, task_id).
        name: of the endpoint.
        begin, halt, terminate: functions of the endpoint.
    """

    def __init__(
        self,
        handlers: Mapping[TaskId, TaskHandler] | None = None,
        name: str = "part",
        *,
        begin: PartStep = nothing,
        halt: PartStep = nothing,
        terminate: PartStep = nothing,
    ) -> None:
        super().__init__()
        self.handlers = dict(handlers or {})
        self.name = name
        self.on_begin, self.on_halt, self.on_terminate = begin, halt, terminate

    def get(self, parent: NodeApi) -> Part:
        """Return the endpoint."""
        return Part(self, parent, self.name)


class Part(Endpoint):
    """An endpoint of functions."""

    factory: PartFactory

    def __init__(self, factory: PartFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = factory.handlers

    def begin(self) -> None:
        """Call the function given for it."""
        self.factory.on_begin(self)

    def halt(self) -> None:
        """Call the function given for it."""
        self.factory.on_halt(self)

    def terminate(self) -> None:
        """Call the function given for it."""
        self.factory.on_terminate(self)


class TickerFactory(LoopFactory):
    """Makes a loop of functions.

    Args:
        loop: function of the loop, called at each tick.
        name: of the loop.
        rate_hz: ticks per second.
        setup, halt, terminate: functions of the loop.
    """

    def __init__(
        self,
        loop: TickerStep = nothing,
        name: str = "ticker",
        rate_hz: float = 100.0,
        *,
        setup: TickerStep = nothing,
        halt: TickerStep = nothing,
        terminate: TickerStep = nothing,
    ) -> None:
        super().__init__()
        self.name = name
        self.rate_hz = rate_hz
        self.on_setup, self.on_loop, self.on_halt, self.on_terminate = setup, loop, halt, terminate

    def get(self, parent: NodeApi) -> Ticker:
        """Return the loop."""
        return Ticker(self, parent, self.name, self.rate_hz)


class Ticker(Loop):
    """A loop of functions."""

    factory: TickerFactory

    def setup(self) -> None:
        """Call the function given for it."""
        self.factory.on_setup(self)

    def loop(self) -> None:
        """Call the function given for it."""
        self.factory.on_loop(self)

    def halt(self) -> None:
        """Call the function given for it."""
        self.factory.on_halt(self)

    def terminate(self) -> None:
        """Call the function given for it."""
        self.factory.on_terminate(self)
