"""Parts of a node: components, and the factories that make them."""

from __future__ import annotations

from types import ModuleType
from typing import Protocol, TypeAlias, runtime_checkable

from snr_sim.prelude.task import SomeTasks, TaskHandlerMap

RoleName: TypeAlias = str


@runtime_checkable
class Component(Protocol):
    """A part of a node: an endpoint or a loop."""

    name: str
    task_handlers: TaskHandlerMap

    def begin(self) -> SomeTasks:
        """Start; called once before the first task. What it returns is executed as first tasks."""

    def join(self) -> None:
        """Stop the component's activity and call its `halt`; called once after the last task."""

    def terminate(self) -> None:
        """Close files and connections; called once after `join`."""


@runtime_checkable
class PortFactory(Protocol):
    """A factory of a component with an exclusive resource: a port to listen at, an end of a pipe."""

    def claim(self) -> None:
        """Listen in advance, so that a port in use is reported before the run starts; the component takes it over.

        Raises:
            LinkError: the port is taken, or the host is not this machine.
        """

    def release(self) -> None:
        """Close it here if no component has taken it over: it is not needed, or another process has it now.

        Safe to call twice.
        """


class Factory(Protocol):
    """Makes one component for a node; keeps data that survive a reload."""

    reload_targets: list[ModuleType]
