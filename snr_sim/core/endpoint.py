"""Endpoints: components whose handlers turn tasks into tasks. Most student code is an endpoint.

`@handles` makes a method the handler of a page or an event:

    class Gentle(Endpoint):
        @handles("radar")
        def on_radar(self, radar):            # the page's data
            return self.store_data_task("engine", {"throttle": 0.3})

is the same, byte for byte in a trace, as

    class Gentle(Endpoint):
        def __init__(self, factory, parent, name):
            super().__init__(factory, parent, name)
            self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

        def on_radar(self, task, task_id):
            radar = self.get_data("radar")
            return self.store_data_task("engine", {"throttle": 0.3})
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from types import FunctionType, MethodType
from typing import Any, ClassVar, Never, TypeVar

from snr_sim.core.component import NodeComponent, declared_key, from_page
from snr_sim.core.factory import ComponentFactory, FactoryOfClass
from snr_sim.core.handlers import HandlerMap, check_handlers, check_returns, describe
from snr_sim.core.source_location import after_line, location_of
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey, SomeTasks, Task, TaskHandler, TaskHandlerMap, TaskId, TaskType


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
        elif "task_handlers" in cls.__dict__ and not isinstance(table, property):
            check_handlers(cls.__name__, table)  # raises, as it cannot be a table

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


Method = TypeVar("Method", bound=Callable[..., SomeTasks])

_SIGNATURE = inspect.signature(lambda self, task, task_id: None)  # of the handlers that are made here
_HANDLED = "__snr_handled__"  # attribute of a decorated function: list of _Handled
_USAGE = '@handles("radar") is for a page, @handles(event="go") for an event.'


@dataclass(frozen=True)
class _Handled:
    """One task that a method handles."""

    task_id: TaskId
    takes_task: bool  # whether it is called with the task, otherwise with the page's data
    page_class: type | None = None  # the class to convert the page's data to


def handles(
    page: DataKey | type | None = None, *more: Never, event: str | None = None, task: bool = False
) -> Callable[[Method], Method]:
    """Make a method of an endpoint the handler of a page or of an event.

    A method that handles a page is called with the page's data; one that handles an event, with the task, whose values
    are in `task.val_list`. Like any handler it returns None, a task, or a list of tasks. Several decorators on one
    method are allowed. Handlers in `task_handlers` are in addition.

    Args:
        page: its key, or a class that `@page` declares: then the data are converted to an object of this class.
        more: none: one decorator is for one page.
        event: its name.
        task: whether the handler of a page is called with the task instead of the data.

    Raises:
        ConfigError: neither or both are given, or several pages, or the method cannot be called with one argument.
    """
    if isinstance(page, FunctionType):
        raise ConfigError(f"@handles above {page.__name__} does not name a page or an event.", fix=_USAGE)
    whole: Any = page  # anything, whatever the annotation says
    named = [*(whole if isinstance(whole, (list, tuple, set, frozenset)) else [whole]), *more]
    if named != [whole]:
        each = " and below it ".join(f"@handles({_shown(one)})" for one in named)
        raise ConfigError(
            f"@handles({', '.join(map(_shown, [whole, *more]))}) does not name one page.",
            fix=f"write one for each: {each}." if named else _USAGE,
        )
    for given in (page, event):
        if isinstance(given, TaskType):
            raise ConfigError(f"@handles({given}) names a kind of tasks, but no page and no event.", fix=_USAGE)
    if (page is None) == (event is None):
        raise ConfigError(
            f"@handles names {'neither a page nor' if page is None else 'a page and'} an event.", fix=_USAGE
        )
    if event is not None:
        if not isinstance(event, str):
            raise ConfigError(f"@handles(event={event!r}): an event's name is text.", fix=_USAGE)
        handled = _Handled((TaskType.event, event), True)
    elif isinstance(page, str):
        handled = _Handled((TaskType.process_data, page), task)
    else:
        handled = _Handled((TaskType.process_data, declared_key(page)), task, None if task else page)

    def decorate(method: Method) -> Method:
        _check_method(method, handled)
        vars(method).setdefault(_HANDLED, []).append(handled)
        return method

    return decorate


def _shown(given: object) -> str:
    return given.__name__ if isinstance(given, type) else repr(given)[:80]


def _check_method(method: Any, handled: _Handled) -> None:
    if not isinstance(method, FunctionType):
        raise ConfigError(f"@handles is above {method!r}, which is not a method.", fix="decorate a def in a class.")
    argument = "task" if handled.takes_task else "data"
    name = method.__name__
    if method.__qualname__ == name:
        message = after_line(
            location_of(method), f"{name}, the handler of {describe(handled.task_id)}, is in no class."
        )
        raise ConfigError(message, fix="indent it, below the class of an Endpoint.")
    check_returns(f"Handler '{name}' for {describe(handled.task_id)}", method)
    signature = inspect.signature(method)
    try:
        signature.bind(None, None)
    except TypeError:
        what = f"{name}, the handler of {describe(handled.task_id)}, takes {signature}"
        message = after_line(location_of(method), f"{what}, but is called with (self, {argument}).")
        raise ConfigError(message, fix=f"def {name}(self, {argument}).") from None


def is_decorated(kind: type) -> bool:
    """Return whether a class has a method with `@handles`."""
    return any(hasattr(member, _HANDLED) for base in kind.__mro__ for member in vars(base).values())


def decorated_handlers(kind: type) -> dict[TaskId, FunctionType]:
    """Return the handlers that `@handles` makes in a class and its bases, by task id, as functions of (self, ...).

    A subclass may override a decorated method, with or without a decorator of its own, and may handle the same task
    with another method.

    Raises:
        ConfigError: two methods of one class handle the same task.
    """
    names: dict[TaskId, tuple[str, _Handled]] = {}
    for base in reversed(kind.__mro__):
        own: dict[TaskId, tuple[str, _Handled]] = {}
        for name, member in vars(base).items():
            for handled in getattr(member, _HANDLED, ()):
                other = own.setdefault(handled.task_id, (name, handled))
                if other[1] is not handled:
                    raise ConfigError(
                        f"{base.__name__} handles {describe(handled.task_id)} twice: in {other[0]} and in {name}.",
                        fix="one method for each page or event; it may call others.",
                    )
        decorated_again = {name for name, _ in own.values()}
        names = {task_id: kept for task_id, kept in names.items() if kept[0] not in decorated_again} | own
    return {task_id: _handler(getattr(kind, name), name, handled) for task_id, (name, handled) in names.items()}


def _handler(method: object, name: str, handled: _Handled) -> FunctionType:
    """Return a handler that calls the method of this name, as it is in the object's class."""
    page_class = handled.page_class

    def call_with_task(self: Any, task: Task, _task_id: TaskId) -> SomeTasks:
        result: SomeTasks = getattr(self, name)(task)
        return result

    def call_with_data(self: Any, task: Task, _task_id: TaskId) -> SomeTasks:
        page = task.page
        data = self.get_data(task.name) if page is None else page.data  # a task without its page was made by hand
        result: SomeTasks = getattr(self, name)(data if page_class is None else from_page(page_class, data))
        return result

    chosen = call_with_task if handled.takes_task else call_with_data
    assert isinstance(chosen, FunctionType)
    chosen.__name__ = name  # the trace has the method's name
    vars(chosen).update(__wrapped__=method, __signature__=_SIGNATURE)  # the line to report; how it is called
    return chosen
