"""Base of endpoints and loops: a name in a node, and access to its pages, time and random numbers.

A page holds a copy of its data from the time of its creation. Parts of the program are rejected, other objects noted.
Data are plain: with `@page("radar")` above a msgspec Struct `Radar` they are a dict with the Struct's fields, so traces
and links need not know the class. `get_data(Radar)` and `@handles(Radar)` return the dict as a `Radar`; storing one
checks its fields.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, overload

import msgspec

from snr_sim.core.factory import ComponentFactory, FactoryOfClass
from snr_sim.core.source_location import SourceLocation, current_location, is_student_file
from snr_sim.core.thesis_members import ComponentMembers
from snr_sim.prelude.errors import ConfigError, TaskError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.task import IMMUTABLE, DataKey, Page, SomeTasks, Task, TaskType, ensure_type_info, snapshot
from snr_sim.prelude.text import visible
from snr_sim.prelude.values import is_of_program

if TYPE_CHECKING:
    import numpy as np


Data = TypeVar("Data")
StructClass = TypeVar("StructClass", bound=type[msgspec.Struct])
CORE_NAME = "node_core"  # the node's own endpoint
_STORE_PAGE = TaskType.store_page  # looked up once: in Python 3.11 a member of an Enum takes 0.1 us to find
_CORE = Path(__file__).parent
_KEY = "__snr_page_key__"  # attribute of a class that `page` declares
_PLAIN = (bool, int, float, str, list, tuple, dict)  # of an attribute that was meant to be a field
_FIX = "store numbers, text, lists, dicts, numpy arrays, or dataclasses of these."


class NodeComponent(ComponentMembers):
    """A part of a node.

    Args:
        factory: its factory.
        parent: its node.
        name: unique in the node.
    """

    # Whether it belongs to the robot. A component that a runner adds does not: a replay runs without it, so it is
    # neither reloaded nor removed.
    is_robot_component: ClassVar[bool] = True
    # Whether a reload of all components includes it. False for a console, whose connection carries the reply.
    is_reloaded_with_all: ClassVar[bool] = True

    # On the class: makes a factory, `Gentle.factory(name="gentle", hover=0.3)`. On a component: the factory it is from.
    factory: FactoryOfClass = FactoryOfClass(ComponentFactory)

    def __init__(self, factory: ComponentFactory, parent: NodeApi, name: str) -> None:
        self.factory = factory
        self.parent: NodeApi = parent
        self.name: str = name
        short = getattr(factory, "_short_form", None)  # a factory need not be one of ours
        if short is not None:
            for key, value in short.settings.items():
                setattr(self, key, value)

    @property
    def watched_files(self) -> Mapping[Path, Callable[[], SomeTasks]]:
        """Files that `--watch` reads for the component, each with what returns the tasks when it was saved."""
        return {}

    def halt(self) -> None:
        """End the work; the node calls it once."""

    def terminate(self) -> None:
        """Close files and connections; the node calls it once, at the very end, on its own thread."""

    def schedule(self, tasks: SomeTasks) -> None:
        """Queue tasks: an endpoint's are results of the task it handles, a loop's are inputs of the node."""
        raise NotImplementedError

    def page(self, key: DataKey, data: Any, process: bool = True) -> Page:
        """Return a page of this node, created now, with a copy of the data: see `data_of_page`."""
        if type(key) is not str:
            check_key(key, data)
        kept = data if type(data) in IMMUTABLE else data_of_page(self.parent, key, data)
        return Page(key, kept, self.parent.name, self.get_time_s(), process)

    def store_page(self, page: Page) -> None:
        """Queue the task that stores a page."""
        self.schedule(Task(_STORE_PAGE, page.key, [page]))

    def store_data(self, key: DataKey, data: Any, process: bool = True) -> None:
        """Queue the task that stores data under a key."""
        self.schedule(self.store_data_task(key, data, process))

    def store_data_task(self, key: DataKey, data: Any, process: bool = True) -> Task:
        """Return the task that stores data under a key, for a handler to return."""
        return Task(_STORE_PAGE, key, [self.page(key, data, process)])

    def get_page(self, key: DataKey) -> Page | None:
        """Return the newest page of a key, or None if nothing has stored it (yet).

        A handler of `process_data` gets the page that its task carries: `task.page`.
        """
        return self.parent.get_page(key)

    @overload
    def get_data(self, key: type[Data]) -> Data | None: ...

    @overload
    def get_data(self, key: DataKey) -> Any: ...

    def get_data(self, key: DataKey | type[Any]) -> Any:
        """Return the data of `get_page`, or None if nothing has stored it (yet).

        Args:
            key: of the page, or a class that `@page` declares: then the data are returned as an object of this class.
        """
        if isinstance(key, type):
            page = self.parent.get_page(declared_key(key))
            return None if page is None else from_page(key, page.data)
        page = self.parent.get_page(key)
        return None if page is None else page.data

    def get_age_s(self, key: DataKey) -> float:
        """Return the age of the page of `get_page` [s], also if another node made it; infinite if unknown."""
        return self.parent.get_age_s(key)

    def get_time_s(self) -> float:
        """Return the node's time [s]: constant during one task."""
        return self.parent.get_time_s()

    @cached_property
    def rng(self) -> np.random.Generator:
        """The component's own random generator, derived from the run's seed and its name."""
        return rng_for(self.parent.component_seed, self.name)

    @cached_property
    def log(self) -> ComponentLog:
        """A logger named after node and component; from INFO up it also writes into the trace of a recorded run."""
        return ComponentLog(logging.getLogger(f"snr.{self.parent.name}.{self.name}"), self)


class ComponentLog(logging.LoggerAdapter[logging.Logger]):
    """A component's logger: its messages are recorded, whether or not they are shown."""

    def __init__(self, logger: logging.Logger, component: NodeComponent) -> None:
        super().__init__(logger, {})
        self._component = component

    def log(self, level: int, msg: object, *args: object, **options: Any) -> None:
        """Record and show a message; the other methods call this one. A wrong call is noted."""
        if level >= logging.INFO or self.isEnabledFor(level):
            msg, args = self._text_of(level, msg, args), ()
        if level >= logging.INFO:
            self._component.parent.record_text(self._component.name, logging.getLevelName(level), f"{msg}\n")
        if not self.isEnabledFor(level):
            return
        if level >= logging.INFO and type(msg) is str:
            msg = visible(msg)  # part of a peer's page, perhaps, and for a terminal
        options["stacklevel"] = options.get("stacklevel", 1) + 1
        super().log(level, msg, *args, **options)

    def _text_of(self, level: int, msg: object, args: tuple[object, ...]) -> object:
        """Return a message as logging formats it. Logging itself would print the whole stack at each wrong call."""
        if not args and type(msg) is str:
            return msg
        try:
            # As LogRecord.getMessage, without making a record, which takes ten times as long.
            values = args[0] if len(args) == 1 and isinstance(args[0], Mapping) and args[0] else args
            return str(msg) % values if args else str(msg)
        except Exception as error:  # also of an object's own __str__
            kind, name = type(error).__name__, self._component.name
            text = f"a message of {type(msg).__name__} and {len(args)} values cannot be worded: {kind}"
            if level >= logging.INFO:  # shown or not, so that a replay notes it too
                location = current_location(sys._getframe())
                self._component.parent.add_note(
                    f"'{name}' logs {text}: {error}\n  Try: as many values as the text has % marks, or an f-string.",
                    "" if location is None else f"{location}\n  ",
                )
            return text


def check_key(key: Any, data: Any) -> None:
    """Raise a TaskError unless a page can have this key."""
    if isinstance(key, str):
        return
    found = f"the {type(key).__name__} {key!r}"[:80]
    if isinstance(data, str):
        fix = f"the key comes first: store_data_task({data!r}, ...)."
    else:
        fix = 'the key is text, and comes first: store_data_task("engine", {"throttle": 0.5}).'
    raise TaskError(f"A page's key is {found}, which is not text.", fix=fix)


def data_of_page(node: NodeApi, key: DataKey, data: Any) -> Any:
    """Return a copy of data for a page of a node; later changes of the original do not affect it.

    An object of a class that `@page` declares becomes a dict.
    An object of another class is not copied, and is noted once with the line that stores it.

    Raises:
        TaskError: the data contain a part of the program, such as an endpoint, or do not fit their declared class.
    """
    if type(data) in IMMUTABLE:
        return data
    if is_declared(data):
        data = to_page(key, data)
    objects: list[Any] = []
    try:
        kept = snapshot(data, objects)
    except RecursionError:
        objects, kept = [data], data
    for one in objects:
        _check(node, key, data, one)
    return kept


def _check(node: NodeApi, key: DataKey, data: Any, found: Any) -> None:
    kind, is_rejected = type(found), is_of_program(found)
    named = f"'{found.name}' of class" if is_rejected and hasattr(found, "name") else "an object of class"
    where = next(_paths_to(found, data, "data"), "data")
    dtype = f" of {found.dtype}" if kind.__module__ == "numpy" and hasattr(found, "dtype") else ""
    what = f"Page '{key}' holds {named} {kind.__qualname__}{dtype} ({where})"
    if is_rejected:
        raise TaskError(f"{what}, which is a part of the program and not data.", fix=_FIX)
    if not node.note_object(key, kind):
        return
    trouble = (
        "it contains itself or is nested too deeply, so it is not recorded, and a later change of it changes the page"
        if found is data and kind in (dict, list, tuple)
        else "it is recorded for people to read, a later change of it changes the page, and it can neither cross a "
        "link nor be an input of a replay"
    )
    location = _storing_line()
    if location is not None:  # no line: snr_sim stores it for a caller who does not handle pages
        node.add_note(f"{location}\n  {what}: {trouble}.\n  Try: {_FIX}")


def _storing_line() -> SourceLocation | None:
    """Return the student's line that stores a page, or None if snr_sim's own code does."""
    frame: FrameType | None = sys._getframe()
    while frame is not None and _CORE in Path(frame.f_code.co_filename).parents:
        frame = frame.f_back
    return current_location(frame) if frame is not None and is_student_file(frame.f_code.co_filename) else None


def _paths_to(found: Any, value: Any, path: str) -> Iterator[str]:
    """Yield the paths to an object in data, as Python expressions."""
    kind = type(value)
    if value is found:
        yield path
    elif issubclass(kind, dict):
        for key, item in value.items():
            yield from _paths_to(found, item, f"{path}[{key!r}]")
    elif issubclass(kind, (list, tuple)):
        for i, item in enumerate(value):
            yield from _paths_to(found, item, f"{path}[{i}]")
    else:
        for name in getattr(kind, "__struct_fields__", ()) or getattr(kind, "__dataclass_fields__", ()):
            yield from _paths_to(found, getattr(value, name), f"{path}.{name}")


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
        return msgspec.convert(plain_data(data), ensure_type_info(kind), from_attributes=True)
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
        checked = msgspec.convert(plain_data(data), ensure_type_info(kind))
    except msgspec.ValidationError as error:
        raise TaskError(f"Page '{key}' is given a {kind.__name__} that is not valid: {_reason(error)}.") from error
    fields: dict[str, Any] = plain_data(checked)
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


def plain_data(value: Any) -> Any:
    """Return a value with each Struct in it as a dict, and each number of numpy as Python's."""
    if isinstance(value, msgspec.Struct):
        return {
            encoded: plain_data(getattr(value, name))
            for name, encoded in zip(value.__struct_fields__, value.__struct_encode_fields__, strict=True)
        }
    if type(value) is list:
        return [plain_data(item) for item in value]
    if type(value) is dict:
        return {key: plain_data(item) for key, item in value.items()}
    numpy = sys.modules.get("numpy")
    return value.item() if numpy is not None and isinstance(value, numpy.generic) else value
