"""Snapshot of an object's state, to restore it when a reload is rolled back."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any


class Snapshot:
    """Snapshot of an object's attributes, with the content of lists, dicts, sets, arrays and some modules' objects.

    Containers are restored in place, so all references to a shared one see the old content. `kinds` names the modules.
    """

    def __init__(self, thing: Any, kinds: Collection[str] = ()) -> None:
        self._kept: dict[int, tuple[Any, Any]] = {}  # by id: a container and a copy of its content
        left: list[Any] = [vars(thing)]
        while left:
            one = left.pop()
            if id(one) in self._kept:
                continue
            if type(one) is tuple:
                left.extend(one)
            elif type(one) in (dict, list, set) or _is_array(one):
                self._kept[id(one)] = one, one.copy()
                left.extend(one.values() if type(one) is dict else one if type(one) is list else ())
            elif type(one).__module__ in kinds and hasattr(one, "__dict__"):
                left.append(vars(one))

    def restore(self) -> None:
        """Restore the attributes and their content."""
        for container, copy in self._kept.values():
            if type(container) is list or _is_array(container):
                container[... if _is_array(container) else slice(None)] = copy
            else:
                container.clear()
                container.update(copy)


def _is_array(value: Any) -> bool:
    return type(value).__module__ == "numpy" and type(value).__name__ == "ndarray"
