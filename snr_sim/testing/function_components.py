"""Components made of plain functions: the environment of a component under test, in one line each.

FunctionEndpointFactory({(TaskType.event, "start"): lambda task, task_id: tasks.terminate("done")})
FunctionLoopFactory(lambda loop: loop.store_data("depth", 1.5), rate_hz=10)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import TaskHandler, TaskId

EndpointStep: TypeAlias = Callable[["FunctionEndpoint"], Any]
LoopStep: TypeAlias = Callable[["FunctionLoop"], Any]


def do_nothing(component: object) -> None:
    """Do nothing."""


class FunctionEndpointFactory(EndpointFactory):
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
        begin: EndpointStep = do_nothing,
        halt: EndpointStep = do_nothing,
        terminate: EndpointStep = do_nothing,
    ) -> None:
        super().__init__()
        self.handlers: dict[TaskId, TaskHandler] = dict(handlers or {})
        self.name: str = name
        self.on_begin: EndpointStep = begin
        self.on_halt: EndpointStep = halt
        self.on_terminate: EndpointStep = terminate

    def get(self, parent: NodeApi) -> FunctionEndpoint:
        """Return the endpoint."""
        return FunctionEndpoint(self, parent, self.name)


class FunctionEndpoint(Endpoint):
    """An endpoint of functions."""

    factory: FunctionEndpointFactory

    def __init__(self, factory: FunctionEndpointFactory, parent: NodeApi, name: str) -> None:
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


class FunctionLoopFactory(LoopFactory):
    """Makes a loop of functions.

    Args:
        loop: function of the loop, called at each tick.
        name: of the loop.
        rate_hz: ticks per second.
        setup, halt, terminate: functions of the loop.
    """

    def __init__(
        self,
        loop: LoopStep = do_nothing,
        name: str = "ticker",
        rate_hz: float = 100.0,
        *,
        setup: LoopStep = do_nothing,
        halt: LoopStep = do_nothing,
        terminate: LoopStep = do_nothing,
    ) -> None:
        super().__init__()
        self.name: str = name
        self.rate_hz: float = rate_hz
        self.on_setup: LoopStep = setup
        self.on_loop: LoopStep = loop
        self.on_halt: LoopStep = halt
        self.on_terminate: LoopStep = terminate

    def get(self, parent: NodeApi) -> FunctionLoop:
        """Return the loop."""
        return FunctionLoop(self, parent, self.name, self.rate_hz)


class FunctionLoop(Loop):
    """A loop of functions."""

    factory: FunctionLoopFactory

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
