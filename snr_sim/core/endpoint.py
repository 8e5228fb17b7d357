"""Endpoints: components whose handlers turn tasks into tasks. Most student code is an endpoint."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import FunctionType, MethodType
from typing import Any, ClassVar

from snr_sim.core.component import NodeComponent
from snr_sim.core.factory import ComponentFactory, FactoryOfClass
from snr_sim.core.handlers import HandlerMap, check_handlers, describe
from snr_sim.core.short_form import decorated_handlers
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, TaskHandler, TaskHandlerMap, TaskId


class EndpointFactory(ComponentFactory):
    """Factory of an endpoint."""

    def get(self, parent: NodeApi) -> Endpoint:
        """Return a new endpoint that belongs to the node `parent`."""
        endpoint: Endpoint = self._create(parent, "endpoint")
        return endpoint


class Endpoint(NodeComponent):
    """A component that handles tasks, all of them on the node's one thread.

    Decorate methods with `@handles`, or set `self.task_handlers` in `__init__`: such a handler is called with
    (task, task_id). Each returns None, a task, or a list of tasks. Take random numbers from `self.rng`, time from
    `self.get_time_s()`, and nothing else from outside: that makes a run repeatable.
    """

    _of_class: ClassVar[Mapping[TaskId, TaskHandler]] = {}
    _decorated: ClassVar[Mapping[TaskId, FunctionType]] = {}

    def __init_subclass__(cls, **options: Any) -> None:
        """Keep the class's handlers, in `task_handlers` or with `@handles`, as the initial ones of each object."""
        super().__init_subclass__(**options)
        cls._decorated = decorated_handlers(cls)
        table = cls.__dict__.get("task_handlers")
        if isinstance(table, Mapping):
            cls._of_class = table
            del cls.task_handlers  # or it would hide the property below, and all objects would share one map

    factory: FactoryOfClass = FactoryOfClass(EndpointFactory)

    # Names of events that no other component needs to handle, or to send.
    optional_events: Collection[str] = ()

    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self._handlers = HandlerMap({}, self._handlers_changed)
        if self._of_class or self._decorated:
            self.task_handlers = {
                task_id: MethodType(handler, self) if isinstance(handler, FunctionType) else handler
                for task_id, handler in self._of_class.items()
            }

    @property
    def task_handlers(self) -> TaskHandlerMap:
        """Handlers by task id. May be changed while the node runs; those with `@handles` stay when a table is set."""
        return self._handlers

    @task_handlers.setter
    def task_handlers(self, handlers: TaskHandlerMap) -> None:
        if "parent" not in self.__dict__:
            raise ConfigError(
                f"{type(self).__name__} sets task_handlers before it has called its parent's __init__.",
                fix="begin its __init__ with: super().__init__(factory, parent, name).",
            )
        check_handlers(self.name, handlers)
        decorated = {task_id: MethodType(function, self) for task_id, function in self._decorated.items()}
        for task_id in decorated.keys() & handlers.keys():
            raise ConfigError(
                f"Component '{self.name}' handles {describe(task_id)} twice: in task_handlers, and with @handles in "
                f"{decorated[task_id].__name__}.",
                fix="one handler for each task; it may call others.",
            )
        self._handlers = HandlerMap({**decorated, **handlers}, self._handlers_changed)
        self._notify_node()

    def _handlers_changed(self) -> None:
        check_handlers(self.name, self._handlers)
        self._notify_node()

    def _notify_node(self) -> None:
        if self.parent.components.get(self.name) is self:  # else the node reads them when it is added
            self.parent.handlers_changed()

    def begin(self) -> SomeTasks:
        """Begin; the node calls it once, before the first task. It may return tasks, as a handler does."""

    def join(self) -> None:
        """End the endpoint's work by calling `halt`."""
        self.halt()

    def schedule(self, tasks: SomeTasks) -> None:
        """Queue tasks, as returning them does."""
        self.parent.schedule(tasks, source=self.name)
