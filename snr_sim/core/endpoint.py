"""Endpoints: components whose handlers turn tasks into tasks. Most of what a student writes is one of these."""

from __future__ import annotations

from collections.abc import Mapping
from types import FunctionType, MethodType
from typing import Any, ClassVar

from snr_sim.core.component import ComponentFactory, NodeComponent
from snr_sim.core.handlers import HandlerMap, check_handlers
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, TaskHandler, TaskHandlerMap, TaskId


class EndpointFactory(ComponentFactory):
    """Makes an endpoint for a node."""

    def get(self, parent: NodeApi) -> Endpoint:
        """Return a new endpoint that belongs to the node `parent`."""
        raise NotImplementedError(f"{type(self).__name__} needs a method get(self, parent) that returns its endpoint")


class Endpoint(NodeComponent):
    """A component that handles tasks, all of them on the node's one thread.

    Set `self.task_handlers` in `__init__`; a handler is called with (task, task_id) and returns None, a task, or a
    list of tasks. Chance comes from `self.rng`, time from `self.get_time_s()`, and nothing else from outside: that
    is what makes a run repeatable.

    Args:
        factory: who made it.
        parent: its node.
        name: unique in the node.
    """

    _of_class: ClassVar[Mapping[TaskId, TaskHandler]] = {}

    def __init_subclass__(cls, **options: Any) -> None:
        """Keep a table `task_handlers` of the class, which each object starts with; functions in it are its methods."""
        super().__init_subclass__(**options)
        table = cls.__dict__.get("task_handlers")
        if isinstance(table, Mapping):
            cls._of_class = table
            del cls.task_handlers  # or it would hide the property below, and all objects would share one map

    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self._handlers = HandlerMap({}, self._handlers_changed)
        if self._of_class:
            self.task_handlers = {
                task_id: MethodType(handler, self) if isinstance(handler, FunctionType) else handler
                for task_id, handler in self._of_class.items()
            }

    @property
    def task_handlers(self) -> TaskHandlerMap:
        """Which task goes to which method. May be changed while the node runs."""
        return self._handlers

    @task_handlers.setter
    def task_handlers(self, handlers: TaskHandlerMap) -> None:
        if "parent" not in self.__dict__:
            raise ConfigError(
                f"{type(self).__name__} sets task_handlers before it has called its parent's __init__.",
                fix="begin its __init__ with: super().__init__(factory, parent, name).",
            )
        check_handlers(self.name, handlers)
        self._handlers = HandlerMap(handlers, self._handlers_changed)
        self._tell_node()

    def _handlers_changed(self) -> None:
        check_handlers(self.name, self._handlers)
        self._tell_node()

    def _tell_node(self) -> None:
        if self.parent.components.get(self.name) is self:  # else it is being made, and the node looks when it comes
            self.parent.handlers_changed()

    def begin(self) -> None:
        """Begin; the node calls it once, before the first task."""

    def join(self) -> None:
        """End the endpoint's work by calling `halt`."""
        self.halt()

    def schedule(self, tasks: SomeTasks) -> None:
        """Queue tasks, as returning them does."""
        self.parent.schedule(tasks, source=self.name)
