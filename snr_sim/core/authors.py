"""Source lines that store the pages of a key. Used only after a page turned out to be invalid.

Recording the line of every page would cost time at each store. So this module reads the components' code afterwards
and returns the lines that could have stored the page: usually one.
"""

from __future__ import annotations

import dis
import linecache
from collections.abc import Iterable, Iterator
from functools import partial
from types import CodeType, FunctionType
from typing import Any, NamedTuple

from snr_sim.core.blame import Place, is_student_file, short_path
from snr_sim.prelude.component import Component
from snr_sim.prelude.page import DataKey


class Author(NamedTuple):
    """A line that names a key, and the component that it belongs to."""

    component: str
    function: str
    place: Place


def authors_of(key: DataKey, components: Iterable[Component]) -> list[Author]:
    """Return the lines in which these components could store pages of a key, in their order; each once.

    Lines that name the key and mention storing or pages are preferred to lines that only name the key.
    """
    found = list(dict.fromkeys(author for component in components for author in _mentions(key, component)))
    storing = [author for author in found if "store" in author.place.source or "page(" in author.place.source]
    return storing or found


def who_stored(key: DataKey, components: Iterable[Component]) -> tuple[str, str]:
    """Return the lines that could have stored a page, as the prefix of an error, and a text that names their owners.

    If no such line is found, the prefix is empty and the text names the remaining candidates.
    """
    components = list(components)
    authors = authors_of(key, components)
    lines = "".join(f"{author.place}\n  " for author in authors)
    names = dict.fromkeys(f"{author.function}() of component '{author.component}'" for author in authors)
    one_of = ", ".join(component.name for component in components)
    return lines, " or ".join(names) or (f"one of {one_of}" if one_of else "somebody outside")


def place_of_attribute(component: Component, name: str) -> Place | None:
    """Return the first line of student code that sets an attribute of a component, or None."""
    for function in _functions(component):
        for step in dis.get_instructions(function.__code__):
            line = step.positions.lineno if step.positions is not None else None
            if step.opname == "STORE_ATTR" and step.argval == name and line is not None:
                file = function.__code__.co_filename
                return Place(short_path(file), line, function.__name__, linecache.getline(file, line).strip())
    return None


def _mentions(key: DataKey, component: Component) -> Iterator[Author]:
    own = vars(component)
    for function in _functions(component):
        names = {name for name, value in {**function.__globals__, **own}.items() if type(value) is str and value == key}
        for code in _nested(function.__code__):
            for step in dis.get_instructions(code):
                is_text = step.opname == "LOAD_CONST" and step.argval == key  # excludes a variable of that name
                is_named = is_text or (step.opname.startswith("LOAD_") and step.argval in names)
                line = step.positions.lineno if step.positions is not None else None
                if is_named and line is not None and type(step.argval) is str:
                    source = linecache.getline(code.co_filename, line).strip()
                    place = Place(short_path(code.co_filename), line, function.__name__, source)
                    yield Author(component.name, function.__name__, place)


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
