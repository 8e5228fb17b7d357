"""Data of a page: a copy from the time of its creation. Parts of the program are rejected, other objects noted."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from snr_sim.core.page_types import is_declared, to_page
from snr_sim.core.source_location import SourceLocation, current_location, is_student_file
from snr_sim.prelude.errors import TaskError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import DataKey
from snr_sim.prelude.snapshot import IMMUTABLE, snapshot
from snr_sim.prelude.values import is_of_program

_CORE = Path(__file__).parent
_FIX = "store numbers, text, lists, dicts, numpy arrays, or dataclasses of these."


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
