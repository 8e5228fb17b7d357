"""Diagnostics of a run: unhandled tasks, handlers that were never called, pages that were never stored.

Recording the line that stores each page would cost time at each store. So the components' code is read afterwards, and
the lines that could have stored a page are found: usually one.
"""

from __future__ import annotations

import difflib
import dis
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import islice
from types import CodeType, FunctionType
from typing import Any, NamedTuple, TypeAlias

from snr_sim.core.component import CORE_NAME
from snr_sim.core.datastore import PREVIOUS, Datastore
from snr_sim.core.endpoint import Endpoint
from snr_sim.core.handlers import Entry, describe
from snr_sim.core.source_location import (
    SourceLocation,
    after_line,
    class_location,
    is_content,
    is_student_file,
    location_in,
    location_of,
)
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.recorder import RECORDING_KEY
from snr_sim.prelude.task import DataKey, Page, TaskName, TaskType

_STEPS = ("begin", "join", "halt", "terminate")
NEXT_LINE = "\n  "
MAX_OF_A_KIND = 10
Find: TypeAlias = Callable[[DataKey, Iterable[Component]], "list[PageWriter]"]
SeenTasks = Mapping[TaskType, Mapping[TaskName, tuple[Entry, ...]]]


def run_diagnostics(
    components: Mapping[str, Component], seen: SeenTasks, datastore: Datastore, find: Find | None = None
) -> list[str]:
    """Return a sentence for each finding, with the nearest known name.

    Args:
        components, datastore: of the node.
        seen: every task id of the run, with its handlers.
        find: returns a student's lines that name a key; default: search the components' code. For a trace it finds
            none, so that a graded run, whose components are in another process, gives the same text.
    """
    find = find or own_writers
    # The node's own endpoint has handlers for requests that are all optional.
    of_the_robot = {name: component for name, component in components.items() if name != CORE_NAME}
    kinds = {
        "tasks without a handler": _unhandled(of_the_robot, seen),
        "handlers that were never called": _never_called(of_the_robot, seen, datastore, find),
        "endpoints without handlers": without_handlers(of_the_robot, seen, with_locations=find is own_writers),
        "pages that were never stored": _never_stored(of_the_robot, datastore, find),
        "pages with the name of another one's previous page": _named_as_previous(datastore),
    }
    return [sentence for kind, sentences in kinds.items() for sentence in _first_few(sentences, kind)]


def _first_few(sentences: Iterator[str], kind: str) -> Iterator[str]:
    """Yield the first sentences of a kind: a program that makes names up may have thousands, and each takes time."""
    yield from islice(sentences, MAX_OF_A_KIND)
    if next(sentences, None) is not None:
        yield f"There are more {kind}, which are left out."


def _optional(components: Mapping[str, Component]) -> set[TaskName]:
    return {name for one in components.values() if isinstance(one, Endpoint) for name in one.optional_events}


def _unhandled(components: Mapping[str, Component], seen: SeenTasks) -> Iterator[str]:
    optional = _optional(components)
    for kind in (TaskType.event, TaskType.reload):
        for name, entries in seen[kind].items():
            if not entries and name not in optional:
                known = {name for _, of, name in _named_ids(components) if of is kind}
                yield f"No component handled {describe((kind, name))}; {suggest(name, known, 'handlers wait for')}"


def _never_called(
    components: Mapping[str, Component], seen: SeenTasks, datastore: Datastore, find: Find
) -> Iterator[str]:
    optional = _optional(components)
    for component, kind, name in _named_ids(components):
        if name in seen[kind] or kind is TaskType.terminate or name == RECORDING_KEY:
            continue
        if kind is TaskType.event and name in optional:
            continue
        waits = f"{_line_of(find(name, [component]))}'{component.name}' waits for {describe((kind, name))}, which"
        if kind is TaskType.process_data and name in datastore.pages:
            yield (
                f"{waits} never came: that page was stored without a task (process=False). "
                f"Look it up: self.get_data({str(name)!r})."
            )
        else:
            verb = "sent" if kind is TaskType.event else "stored" if kind is not TaskType.reload else "requested"
            near = _same_or_nearest(name, kind, seen, lambda key: find(key, components.values()), verb)
            if kind is TaskType.event and name in datastore.pages:
                near = (
                    f"there is a page of that name: @handles({str(name)!r}), or (TaskType.process_data, {str(name)!r})."
                )
            yield f"{waits} was never {verb}; {near}"


def _same_or_nearest(
    name: TaskName, kind: TaskType, seen: SeenTasks, find: Callable[[DataKey], list[PageWriter]], verb: str
) -> str:
    """Suggest the nearest name, unless that one has no handler either and may itself be the misspelt one."""
    close = difflib.get_close_matches(name, seen[kind], n=1, cutoff=0.5)
    is_ours = bool(close) and (kind is TaskType.event or any(map(_stores, find(close[0]))))
    if not (is_ours and not seen[kind][close[0]]):
        return suggest(name, seen[kind], f"{verb} were")
    location = _line_of(find(close[0])).strip()
    where = f" ({location})" if location else ""
    return f"'{close[0]}' was {verb}{where}, but no handler waits for it: spell both alike."


def without_handlers(
    components: Mapping[str, Component], seen: SeenTasks | None = None, with_locations: bool = True
) -> Iterator[str]:
    """Yield a sentence for each endpoint without any effect; one that overrides `begin`, `halt` or similar has one.

    Args are as for `run_diagnostics`; `seen` is empty before a run, and `with_locations` finds the line to fix.
    """
    called = {entry[0].name for by_name in (seen or {}).values() for entries in by_name.values() for entry in entries}
    for component in components.values():
        is_idle = isinstance(component, Endpoint) and not component.task_handlers and component.name not in called
        if is_idle and all(getattr(type(component), step) is getattr(Endpoint, step) for step in _STEPS):
            begins = difflib.get_close_matches("__init__", vars(type(component)), n=1, cutoff=0.8)
            if with_locations and begins and begins[0] != "__init__":
                location = location_of(getattr(component, begins[0]))
                yield f"{location}{NEXT_LINE}Endpoint '{component.name}' has no handlers; did you mean '__init__'?"
                continue
            names = [one for one in vars(component) if one[0] != "_"] if with_locations else []
            close = difflib.get_close_matches("task_handlers", names, n=1)
            what = (
                f"Endpoint '{component.name}' has no handlers, so nothing calls it; "
                f"set self.task_handlers = {{...}} in its __init__{f', not self.{close[0]}' if close else ''}."
            )
            yield after_line(attribute_location(component, close[0]) if close else None, what)


def _never_stored(components: Mapping[str, Component], datastore: Datastore, find: Find) -> Iterator[str]:
    for key in datastore.missed:
        if key in datastore.pages or key == RECORDING_KEY:  # stored only if the recording has a problem
            continue
        writers = find(str(key), components.values())
        if not writers:  # snr_sim requested it, so the name is right
            yield _misnamed(str(key), components, datastore, find)
            continue
        unreturned = next((one for one in writers if _is_dropped(one.location.source)), None)
        if unreturned is not None:
            yield (
                f"{unreturned.location}{NEXT_LINE}Page '{key}' was requested but never stored: "
                f"{unreturned.function}() of '{unreturned.component}' makes the task and does not return it. "
                f"Write: return {unreturned.location.source}"
            )
            continue
        near = suggest(str(key), datastore.pages, "stored were")
        if _stores(writers[0]):
            near = f"{writers[0].function}() of '{writers[0].component}' never came to this line."
        yield f"{writers[0].location}{NEXT_LINE}Page '{key}' was requested but never stored; {near}"


def _misnamed(key: DataKey, components: Mapping[str, Component], datastore: Datastore, find: Find) -> str:
    """Return the sentence on a missing page; a stored page of a similar name without handlers is the misspelt one."""
    waited_for = {name for _, _, name in _named_ids(components)}
    message = f"Page '{key}' was requested but never stored"
    for other in difflib.get_close_matches(key, map(str, datastore.pages), n=3, cutoff=0.5):
        writers = find(other, components.values())
        if other not in waited_for and writers:
            return (
                f"{writers[0].location}{NEXT_LINE}Page '{other}' is stored there, but no handler waits for it. "
                f"{message}: did you mean '{key}'?"
            )
    return f"{message}; {suggest('', datastore.pages, 'stored were')}"


def _stores(writer: PageWriter) -> bool:
    return "store" in writer.location.source or "page(" in writer.location.source


def _is_dropped(source: str) -> bool:
    """Return whether a line creates a task and does not use it."""
    return source.startswith(("self.store_data_task(", "tasks.", "Task("))


def own_writers(key: DataKey, components: Iterable[Component]) -> list[PageWriter]:
    """Return the student's lines that name a key; lines of shipped robots are left out."""
    return [one for one in writers_of(key, components) if not is_content(one.location.file)]


def no_writers(_key: DataKey, _components: Iterable[Component]) -> list[PageWriter]:
    """Find no lines."""
    return []


def _line_of(writers: list[PageWriter]) -> str:
    return f"{writers[0].location}{NEXT_LINE}" if writers else ""


def _named_as_previous(datastore: Datastore) -> Iterator[str]:
    for key in datastore.pages:
        if key.endswith(PREVIOUS) and (newest := key.removesuffix(PREVIOUS)) in datastore.pages:
            yield (
                f"Page '{key}' was stored, which is also the name of the page before the newest '{newest}': "
                f"self.get_data({key!r}) gave the stored one. Give it another name."
            )


def _named_ids(components: Mapping[str, Component]) -> Iterator[tuple[Component, TaskType, TaskName]]:
    """Yield each component with kind and name of the tasks that it handles by name."""
    for component in components.values():
        for task_id in component.task_handlers:
            if isinstance(task_id, tuple):
                yield component, *task_id


class PageWriter(NamedTuple):
    """A line that names a key, and the component that it belongs to."""

    component: str
    function: str
    location: SourceLocation


class WriterInfo(NamedTuple):
    """What an error says of the component that has stored a page."""

    lines: str  # that could have stored it: the beginning of the error, or empty
    who: str  # the functions of these lines and their components
    suspects: tuple[str, ...]  # the components


def writers_of(key: DataKey, components: Iterable[Component]) -> list[PageWriter]:
    """Return the lines in which these components could store pages of a key, in their order; each once.

    Lines that name the key and mention storing or pages are preferred to lines that only name the key.
    """
    found = list(dict.fromkeys(writer for component in components for writer in _mentions(key, component)))
    storing = [writer for writer in found if "store" in writer.location.source or "page(" in writer.location.source]
    return storing or found


def find_writer(key: DataKey, components: Iterable[Component]) -> WriterInfo:
    """Return what an error says of the component that has stored a page; without such a line, all are candidates.

    A single candidate without such a line, as it puts the key together, is named with the line of its class.
    """
    components = list(components)
    writers = writers_of(key, components)
    if not writers and len(components) == 1:
        location, name = class_location(type(components[0])), components[0].name
        return WriterInfo("" if location is None else f"{location}{NEXT_LINE}", f"component '{name}'", (name,))
    lines = "".join(f"{writer.location}\n  " for writer in writers)
    names = dict.fromkeys(f"{writer.function}() of component '{writer.component}'" for writer in writers)
    one_of = ", ".join(component.name for component in components)
    suspects = [one.component for one in writers] or [one.name for one in components]
    return WriterInfo(lines, " or ".join(names) or f"one of {one_of}", tuple(dict.fromkeys(suspects)))


def describe_unusable_page(node: NodeApi, page: Page, what: str, reader: str) -> tuple[str, tuple[str, ...]]:
    """Return an error's text with the maker of the page that it is about, and the node's components that may be it.

    Args:
        node: which has the page.
        page: that cannot be used.
        what: the text so far: why it cannot.
        reader: the component that cannot use it.
    """
    when = f"at t = {page.created_at_s:.3f} s"
    if page.origin != node.name:
        return f"{what}\n  It was made {when} by node '{page.origin}'.", ()
    lines, who, suspects = node.find_writer(page.key, reader)
    return f"{lines}{what}\n  It was stored {when} by {who}.", suspects


def attribute_location(component: Component, name: str) -> SourceLocation | None:
    """Return the first line of student code that sets an attribute of a component, or None."""
    for function in _functions(component):
        for step in dis.get_instructions(function.__code__):
            if step.opname == "STORE_ATTR" and step.argval == name and (line := _line_of_step(step)) is not None:
                return location_in(function.__code__, line, function.__name__)
    return None


def _line_of_step(step: dis.Instruction) -> int | None:
    return step.positions.lineno if step.positions is not None else None


def _mentions(key: DataKey, component: Component) -> Iterator[PageWriter]:
    own = vars(component)
    for function in _functions(component):
        names = {name for name, value in {**function.__globals__, **own}.items() if type(value) is str and value == key}
        for code in _nested(function.__code__):
            for step in dis.get_instructions(code):
                is_text = step.opname == "LOAD_CONST" and step.argval == key  # excludes a variable of that name
                is_named = is_text or (step.opname.startswith("LOAD_") and step.argval in names)
                if is_named and type(step.argval) is str and (line := _line_of_step(step)) is not None:
                    yield PageWriter(component.name, function.__name__, location_in(code, line, function.__name__))


def _functions(component: Component) -> Iterator[FunctionType]:
    """Yield a component's student code: methods of its class, and functions passed to it or its factory."""
    members = [member for kind in type(component).__mro__ for member in vars(kind).values()]
    given = [*component.task_handlers.values(), *vars(component).values()]
    made_by: Any = getattr(component, "factory", None)
    given += vars(made_by).values() if hasattr(made_by, "__dict__") else ()
    for member in (*members, *given):
        function = member.func if isinstance(member, partial) else member
        function = getattr(function, "__func__", function)
        if isinstance(function, FunctionType) and is_student_file(function.__code__.co_filename):
            yield function


def _nested(code: CodeType) -> Iterator[CodeType]:
    """Yield a function's code, and that of the functions and comprehensions in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _nested(constant)
