"""Short form of endpoints: `@handles` makes a method the handler of a page or an event, `@page` declares a page's type.

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

Every page holds plain data. With `@page("radar")` above a msgspec Struct `Radar` it is a dict with the Struct's fields,
so traces, links and other components need not know the class. `get_data(Radar)` and `@handles(Radar)` return the dict
as a `Radar`; storing a `Radar` checks its fields.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import FunctionType
from typing import Any, TypeVar

import msgspec

from snr_sim.core.handlers import check_returns, describe
from snr_sim.core.source_location import after_line, location_of
from snr_sim.prelude.errors import ConfigError, TaskError
from snr_sim.prelude.task import DataKey, SomeTasks, Task, TaskId, TaskType, ensure_type_info

StructClass = TypeVar("StructClass", bound=type[msgspec.Struct])
Data = TypeVar("Data")
_KEY = "__snr_page_key__"  # attribute of a declared class
_PLAIN = (bool, int, float, str, list, tuple, dict)  # of an attribute that was meant to be a field


def page(key: DataKey) -> Callable[[StructClass], StructClass]:
    """Declare a msgspec Struct as the data of the page with this key.

    Args:
        key: of the page.

    Raises:
        ConfigError: the key is not text, or the class is not a Struct.

    >>> @page("radar")
    ... class Radar(msgspec.Struct):
    ...     altitude_m: float
    ...     velocity_mps: float
    >>> from_page(Radar, {"altitude_m": 120, "velocity_mps": -8.5, "stamp_s": 2.0}).altitude_m
    120.0
    """
    given_key: object = key
    if not isinstance(given_key, str):
        raise ConfigError(f"@page is given {key!r} instead of the key of a page.", fix='write @page("radar").')

    def declare(kind: StructClass) -> StructClass:
        given: object = kind  # any class, whatever the annotation says
        if not isinstance(given, msgspec.StructMeta):
            name = getattr(kind, "__name__", repr(kind))
            raise ConfigError(
                f'@page("{key}") is on {name}, which is not a msgspec.Struct.', fix=f"class {name}(msgspec.Struct):"
            )
        for name, value in list(vars(kind).items()):
            if (
                isinstance(value, _PLAIN)
                and name not in kind.__annotations__
                and not (name.isupper() or name[0] == "_")
            ):
                raise ConfigError(
                    f'@page("{key}") is on {kind.__name__}, whose {name} has no type, so it is not a field.',
                    fix=f"{name}: {type(value).__name__} = {value!r}",
                )
        setattr(kind, _KEY, key)
        return kind

    return declare


def declared_key(kind: object) -> DataKey:
    """Return the key of the page that a class declares; raise a ConfigError if it declares none."""
    key = getattr(kind, _KEY, None) if isinstance(kind, type) else None
    if not isinstance(key, str):
        name = getattr(kind, "__name__", repr(kind))
        raise ConfigError(
            f"{name} is neither the key of a page nor a class that declares one.",
            fix=f'pass the key as text, such as "radar", or write @page("radar") above class {name}(msgspec.Struct).',
        )
    return key


def from_page(kind: type[Data], data: object) -> Data:
    """Return the data of a page as an object of its declared class; the caller may change it.

    Raises:
        TaskError: the data do not fit the class.
    """
    try:
        return msgspec.convert(data, ensure_type_info(kind), from_attributes=True)
    except msgspec.ValidationError:
        pass  # it may hold numpy's numbers, which msgspec does not take for numbers
    try:
        return msgspec.convert(_plain(data), ensure_type_info(kind), from_attributes=True)
    except msgspec.ValidationError as error:
        key = declared_key(kind)
        raise TaskError(
            f"Page '{key}' does not fit {kind.__name__}: {_reason(error)}.",
            fix=f'get_data("{key}") returns what the page holds; compare it with the fields of {kind.__name__}.',
        ) from error


def to_page(key: DataKey, data: msgspec.Struct) -> dict[str, Any]:
    """Return the fields of an object of a declared class as a dict, checked against the types of its fields.

    Raises:
        TaskError: the class is declared for another page, or a field does not fit its type.
    """
    kind = type(data)
    own_key = declared_key(kind)
    if own_key != key:
        raise TaskError(
            f"Page '{key}' is given a {kind.__name__}, which is declared as page '{own_key}'.",
            fix=f"store_data(\"{own_key}\", ...), or another class for page '{key}'.",
        )
    try:
        checked = msgspec.convert(_plain(data), ensure_type_info(kind))
    except msgspec.ValidationError as error:
        raise TaskError(f"Page '{key}' is given a {kind.__name__} that is not valid: {_reason(error)}.") from error
    fields: dict[str, Any] = _plain(checked)
    return fields


def is_declared(data: object) -> bool:
    """Return whether data are an object of a class that `page` declares."""
    return hasattr(type(data), _KEY)  # asks the class only: an object may raise when it is inspected


def _reason(error: msgspec.ValidationError) -> str:
    """Return msgspec's message with the path to the field in Python's words.

    >>> _reason(msgspec.ValidationError("Expected `float`, got `str` - at `$.start.altitude_m`"))
    'Expected `float`, got `str` in field `start.altitude_m`'
    """
    return str(error).replace(" - at `$.", " in field `")


def _plain(value: Any) -> Any:
    """Return a value with each Struct in it as a dict, and each number of numpy as Python's."""
    if isinstance(value, msgspec.Struct):
        return {
            encoded: _plain(getattr(value, name))
            for name, encoded in zip(value.__struct_fields__, value.__struct_encode_fields__, strict=True)
        }
    if type(value) is list:
        return [_plain(item) for item in value]
    if type(value) is dict:
        return {key: _plain(item) for key, item in value.items()}
    numpy = sys.modules.get("numpy")
    return value.item() if numpy is not None and isinstance(value, numpy.generic) else value


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
    page: DataKey | type | None = None, *, event: str | None = None, task: bool = False
) -> Callable[[Method], Method]:
    """Make a method of an endpoint the handler of a page or of an event.

    A method that handles a page is called with the page's data; one that handles an event, with the task, whose values
    are in `task.val_list`. Like any handler it returns None, a task, or a list of tasks. Several decorators on one
    method are allowed. Handlers in `task_handlers` are in addition.

    Args:
        page: its key, or a class that `@page` declares: then the data are converted to an object of this class.
        event: its name.
        task: whether the handler of a page is called with the task instead of the data.

    Raises:
        ConfigError: neither or both are given, or the method cannot be called with one argument.
    """
    if isinstance(page, FunctionType):
        raise ConfigError(f"@handles above {page.__name__} does not name a page or an event.", fix=_USAGE)
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

    def call_with_task(self: Any, task: Task, task_id: TaskId) -> SomeTasks:
        result: SomeTasks = getattr(self, name)(task)
        return result

    def call_with_data(self: Any, task: Task, task_id: TaskId) -> SomeTasks:
        page = task.page
        data = self.get_data(task.name) if page is None else page.data  # a task without its page was made by hand
        result: SomeTasks = getattr(self, name)(data if page_class is None else from_page(page_class, data))
        return result

    chosen = call_with_task if handled.takes_task else call_with_data
    assert isinstance(chosen, FunctionType)
    chosen.__name__ = name  # the trace has the method's name
    vars(chosen).update(__wrapped__=method, __signature__=_SIGNATURE)  # the line to report; how it is called
    return chosen
