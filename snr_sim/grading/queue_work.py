"""How much work a data structure does in lab 11: counted and not timed, so the same on any computer.

Work is every comparison of priorities, and every place in a program's own lists, dicts and deques that holds something
else than before. It is counted where the lists are, in the student's process. A program that could reach this counter
is found by reading it (`plain_code.py`), and one that compares without being seen by the CPU time that the kernel
counts.
"""

from __future__ import annotations

import gc
import operator
from collections import deque
from collections.abc import Callable, Sequence
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

from snr_sim.prelude.task import Task, TaskType


class Priority(int):
    """A priority that counts how often priorities are compared, and stays one when it is reckoned with."""

    compared = 0
    __hash__ = int.__hash__


def _counted(name: str) -> Callable[[int, Any], Any]:
    plain = getattr(int, name)

    def compare(self: int, other: Any) -> Any:
        Priority.compared += 1
        return plain(self, other)

    return compare


def _kept(name: str) -> Callable[..., Any]:
    plain = getattr(int, name)

    def reckon(self: int, *others: Any) -> Any:
        result = plain(self, *others)
        return Priority(result) if type(result) is int else result

    return reckon


for _name in ("__lt__", "__le__", "__gt__", "__ge__", "__eq__", "__ne__"):
    setattr(Priority, _name, _counted(_name))
for _name in ("__neg__", "__pos__", "__add__", "__radd__", "__sub__", "__rsub__", "__mul__", "__rmul__"):
    setattr(Priority, _name, _kept(_name))


def contents(*roots: Any, home: str = "") -> dict[int, tuple[Any, ...]]:
    """Returns what each list, dict, deque, set, object, function and generator holds that can be reached, by identity.

    The first item of each is the container itself, so that none of them goes away while it is compared.

    Args:
        roots: where to begin.
        home: name of the module whose classes and functions are looked into; those of others are not.
    """
    found: dict[int, tuple[Any, ...]] = {}
    waiting: list[Any] = list(roots)
    while waiting:
        one = waiting.pop()
        if type(one) in _PLAIN or isinstance(one, _OTHERS) or id(one) in found:
            continue
        if isinstance(one, (type, FunctionType)) and one.__module__ != home:
            continue
        inside = _inside(one)
        found[id(one)] = (one, *inside)
        waiting.extend(inside)
    return found


_PLAIN = {int, float, bool, str, bytes, Task, TaskType, Priority, type(None)}
_OTHERS = (ModuleType, BuiltinFunctionType, CodeType)
_KINDS: tuple[type[Any], ...] = (list, tuple, deque, set, frozenset)


def _inside(one: Any) -> Sequence[Any]:
    """Asks none of the student's own methods: an iterator of theirs could leave something out."""
    if isinstance(one, FunctionType):
        return [*(one.__closure__ or ()), *(one.__defaults__ or ()), *(one.__kwdefaults__ or {}).values()]
    items: list[Any] = []
    if isinstance(one, dict):
        items = [*dict.keys(one), *dict.values(one)]
    for kind in _KINDS:
        if isinstance(one, kind):
            items = list(kind.__iter__(one))
    if type(one) in (dict, *_KINDS):
        return items
    known = set(map(id, items))
    return [*items, *(other for other in gc.get_referents(one) if id(other) not in known)]


def written(before: dict[int, tuple[Any, ...]], now: dict[int, tuple[Any, ...]]) -> int:
    """Returns how many places hold something else than before; all places of what is new."""
    return sum(_changed(before.get(identity, ()), holds) for identity, holds in now.items())


def _changed(held: tuple[Any, ...], holds: tuple[Any, ...]) -> int:
    """Returns in how many places one container changed."""
    if len(held) == len(holds) and not any(map(operator.is_not, held, holds)):
        return 0
    if held and isinstance(holds[0], (dict, set)):  # what is in them has no place that another could push it from
        return len(set(map(id, held)) ^ set(map(id, holds)))
    gone = 0
    if held and isinstance(holds[0], deque):  # what leaves at its front moves nobody
        gone = next((i for i, one in enumerate(held[1:]) if len(holds) > 1 and one is holds[1]), len(held) - 1)
        held = (held[0], *held[1 + gone :])
    return gone + sum(map(operator.is_not, held, holds)) + abs(len(holds) - len(held))
