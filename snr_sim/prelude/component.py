"""What a node is made of: components, and the factories that make them."""

from __future__ import annotations

from types import ModuleType
from typing import Protocol, TypeAlias, runtime_checkable

from snr_sim.prelude.task import TaskHandlerMap

RoleName: TypeAlias = str


@runtime_checkable
class Component(Protocol):
    """A part of a node: an endpoint or a loop."""

    name: str
    task_handlers: TaskHandlerMap

    def begin(self) -> None:
        """Begin; called once before the first task."""
        ...

    def join(self) -> None:
        """End what the component runs, and call its `halt`; called once after the last task."""
        ...

    def terminate(self) -> None:
        """Close files and wires; called once after `join`."""
        ...


@runtime_checkable
class PortFactory(Protocol):
    """A factory of a component that has what only one program can have: a port to listen at, an end of a pipe."""

    def claim(self) -> None:
        """Listen already, so that a port that is taken is told before there is a run; the component takes it over.

        Raises:
            LinkError: the port is taken, or the host is not this machine.
        """
        ...

    def release(self) -> None:
        """Close it here, if no component has taken it over: nobody needs it, or another process has it now.

        Safe to call twice.
        """
        ...


class Factory(Protocol):
    """Makes one component for a node; keeps what is to survive a reload."""

    reload_targets: list[ModuleType]
