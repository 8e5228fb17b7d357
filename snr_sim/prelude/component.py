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
        """Called once before the first task."""
        ...

    def join(self) -> None:
        """Called once after the last task: ends what the component runs, calling its `halt`."""
        ...

    def terminate(self) -> None:
        """Called once after `join`, to let go of files and wires."""
        ...


class Factory(Protocol):
    """Makes one component for a node; keeps what is to survive a reload."""

    reload_targets: list[ModuleType]
