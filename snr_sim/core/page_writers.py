"""Source lines that store the pages of a key. Used only after a page turned out to be invalid.

Recording the line of every page would cost time at each store. So this module reads the components' code afterwards
and returns the lines that could have stored the page: usually one.
"""

from __future__ import annotations

import dis
from collections.abc import Iterable, Iterator
from functools import partial
from types import CodeType, FunctionType
from typing import Any, NamedTuple

from snr_sim.core.source_location import SourceLocation, is_student_file, location_in
from snr_sim.prelude.component import Component
from snr_sim.prelude.page import DataKey


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
    """Return what an error says of the component that has stored a page; without such a line, all are candidates."""
    components = list(components)
    writers = writers_of(key, components)
    lines = "".join(f"{writer.location}\n  " for writer in writers)
    names = dict.fromkeys(f"{writer.function}() of component '{writer.component}'" for writer in writers)
    one_of = ", ".join(component.name for component in components)
    suspects = [one.component for one in writers] or [one.name for one in components]
    return WriterInfo(lines, " or ".join(names) or f"one of {one_of}", tuple(dict.fromkeys(suspects)))


def attribute_location(component: Component, name: str) -> SourceLocation | None:
    """Return the first line of student code that sets an attribute of a component, or None."""
    for function in _functions(component):
        for step in dis.get_instructions(function.__code__):
            if step.opname == "STORE_ATTR" and step.argval == name and (line := _line_of(step)) is not None:
                return location_in(function.__code__, line, function.__name__)
    return None


def _line_of(step: dis.Instruction) -> int | None:
    return step.positions.lineno if step.positions is not None else None


def _mentions(key: DataKey, component: Component) -> Iterator[PageWriter]:
    own = vars(component)
    for function in _functions(component):
        names = {name for name, value in {**function.__globals__, **own}.items() if type(value) is str and value == key}
        for code in _nested(function.__code__):
            for step in dis.get_instructions(code):
                is_text = step.opname == "LOAD_CONST" and step.argval == key  # excludes a variable of that name
                is_named = is_text or (step.opname.startswith("LOAD_") and step.argval in names)
                if is_named and type(step.argval) is str and (line := _line_of(step)) is not None:
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
