"""Snapshot of an object's state, to restore it when a reload is rolled back."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any


class Snapshot:
    """Snapshot of an object's attributes, with the content of lists, dicts, sets, arrays and some modules' objects.

    Containers are restored in place, so all references to a shared one see the old content. `kinds` names the modules.
    """

    def __init__(self, thing: Any, kinds: Collection[str] = ()) -> None:
        self._kinds = kinds
        self._kept: dict[int, tuple[Any, Any]] = {}  # by id: a container and a copy of its content
        self._keep(vars(thing))

    def _keep(self, container: Any) -> None:
        left = [container]
        while left:
            one = left.pop()
            if id(one) in self._kept:
                continue
            inside: Iterable[Any] = ()
            if type(one) is dict:
                inside = one.values()
            elif type(one) is list:
                inside = one
            elif type(one) is tuple:
                left.extend(one)
                continue
            elif type(one).__module__ in self._kinds and hasattr(one, "__dict__"):
                left.append(vars(one))
                continue
            elif type(one) is not set and not _is_array(one):
                continue
            self._kept[id(one)] = one, one.copy()
            left.extend(inside)

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
