"""Blocks whose readings, times and random numbers are not known: each is executed once for each way that it can go.

    robot.x.read() --> None or an Unknown --> a test of it is a choice --> the next execution takes the other one

A reading is None or a number. What an unknown value is given to and cannot follow raises; then all that the block
assigns is unknown. (Blocks compare by `is` with None only.)
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from operator import itemgetter
from typing import Any, TypeAlias

from snr_sim.behaviors.context import MAX_WORK
from snr_sim.behaviors.program import Bindings, Block

MAX_WAYS = 64  # of one block; beyond it nothing is known of its result
_WORD = re.compile(r"\w+")


class _Any:
    """In the place of the value of a variable that may have any value."""

    def __repr__(self) -> str:
        return "any value"


ANY_VALUE: Any = _Any()
BOTH: tuple[bool, ...] = (False, True)
Values: TypeAlias = tuple[Any, ...]  # of all variables, and what else belongs to a configuration


class Unknown:
    """A number of which nothing is known: so is what is computed with it, and each test of it is a choice."""

    __hash__ = None  # type: ignore[assignment]

    def __init__(self, choices: Choices) -> None:
        self._choices = choices

    def __bool__(self) -> bool:
        return self._choices.choose()

    def _with(self, other: Any = 0) -> Unknown:
        if isinstance(other, (int, float, Unknown)):
            return self
        raise TypeError(f"a number and {other!r:.40}")

    __lt__ = __le__ = __gt__ = __ge__ = __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = _with
    __neg__ = __pos__ = __abs__ = _with

    def __eq__(self, other: object) -> Any:
        return self

    __ne__ = __eq__

    def __truediv__(self, other: Any) -> Unknown:
        if isinstance(other, Unknown) or not other:
            raise ZeroDivisionError
        return self._with(other)

    __mod__ = __floordiv__ = __truediv__

    def __str__(self) -> str:
        raise TypeError("the text of an unknown number")

    __repr__ = __str__

    def __format__(self, form: str) -> str:
        return str(self)


class Choices:
    """The choices of an execution: all combinations, one after the other."""

    def __init__(self) -> None:
        self._taken: list[bool] = []
        self._next = 0
        self._value = Unknown(self)
        self.is_used = False  # whether an unknown number was given out

    def executions(self) -> Iterator[None]:
        """Yield once for each combination of choices."""
        self._taken = []
        while True:
            self._next, self.is_used = 0, False
            yield
            while self._taken and self._taken[-1]:
                self._taken.pop()
            if not self._taken:
                return
            self._taken[-1] = True

    def choose(self) -> bool:
        """Return the next choice."""
        if self._next == len(self._taken):
            self._taken.append(False)
        self._next += 1
        return self._taken[self._next - 1]

    def number(self, *_: object) -> Unknown:
        """Return an unknown number."""
        self.is_used = True
        return self._value

    def reading(self, *_: object) -> Unknown | None:
        """Return an unknown number, or None."""
        return None if self.choose() else self.number()


class Slots(list[Any]):
    """The values of variables; of those that are not followed, assignments are lost.

    Args:
        choices: give the values that are not known.
        values: with ANY_VALUE of those that are not followed.
    """

    def __init__(self, choices: Choices, values: list[Any]) -> None:
        super().__init__(values)
        self._choices = choices
        self.followed: frozenset[int] = frozenset(i for i, value in enumerate(values) if value is not ANY_VALUE)

    def __getitem__(self, index: Any) -> Any:
        value = self.raw(index)
        return self._choices.reading() if value is ANY_VALUE else value

    def __setitem__(self, index: Any, value: Any) -> None:
        if index in self.followed:
            super().__setitem__(index, value)

    def raw(self, index: int) -> Any:
        """Return a value as it is kept: maybe ANY_VALUE."""
        return super().__getitem__(index)


class _Part:
    """A part of a robot of which nothing is known: see `bridge.Part`."""

    def __init__(self, choices: Choices) -> None:
        self.read = self.read_since_entry = choices.reading
        self.age_ms = choices.number

    def start(self, value: object) -> None:
        if not isinstance(value, (int, float, Unknown)):
            raise TypeError(f"start({value!r:.40})")

    def stop(self) -> None: ...


class _Robot:
    """A robot whose parts may have any name."""

    def __init__(self, choices: Choices) -> None:
        self._part = _Part(choices)

    def __getattr__(self, name: str) -> _Part:
        return self._part

    def stop(self, *names: str) -> None: ...


class _Context:
    """What blocks are called with: see `MachineContext`."""

    def __init__(self, choices: Choices) -> None:
        self._choices = choices
        self.random = choices.number
        self.work = MAX_WORK

    def __getattr__(self, name: str) -> Unknown:
        if name in ("now_ns", "in_state_ms", "signal"):
            return self._choices.number()
        raise AttributeError(name)

    def log(self, text: object) -> None: ...


class UnknownWorld:
    """What blocks are bound to, if nothing is known but the variables.

    Args:
        values: of all variables; ANY_VALUE of those that are not followed.
        actions: names of functions of Python files: of a block that calls one, nothing is known.
    """

    def __init__(self, values: list[Any], actions: Collection[str]) -> None:
        self.choices: Choices = Choices()
        self.slots: Slots = Slots(self.choices, values)
        self.robot: _Robot = _Robot(self.choices)
        self.context: _Context = _Context(self.choices)
        self._actions = frozenset(actions)

    def can_follow(self, block: Block) -> bool:
        """Return whether a block can be executed: no function in Python, nor what calls one."""
        code = getattr(block.bind, "code", block.text)
        return block.writes is not None and self._actions.isdisjoint(_WORD.findall(code))


class UnknownBlock:
    """A block at its place in a program, and what it results in, by the values of the variables that it names.

    Args:
        block: of a text, or a function in Python.
        index: places of the variables that can be seen, by name.
        world: to which it is bound.
    """

    def __init__(self, block: Block, index: Mapping[str, int], world: UnknownWorld) -> None:
        slots, names = world.slots, index if block.writes is None else block.writes
        self._world = world
        self._reads = sorted({index[key] for key in block.keys} & slots.followed)
        self._writes = sorted({index[name] for name in names} & slots.followed)
        self._known: Callable[[Any], Any] = itemgetter(*self._reads) if self._reads else lambda values: None
        self._call = block.bind(Bindings(slots, index, world.robot)) if world.can_follow(block) else None
        self._results: dict[Any, Any] = {}

    def test(self, values: Values) -> tuple[bool, ...]:
        """Return what a condition can be: (False,), (True,) or BOTH."""
        known = self._known(values)
        found: tuple[bool, ...] | None = self._results.get(known)
        if found is None:
            results = self._executed(values, bool, False)
            self._results[known] = found = BOTH if results is None else tuple(results)
        return found

    def after(self, values: Values) -> list[Values]:
        """Return what the values can be after the block."""
        if not self._writes:
            return [values]
        known = self._known(values)
        found: list[Values] | None = self._results.get(known)
        if found is None:
            raw, writes = self._world.slots.raw, self._writes
            before = tuple(values[i] for i in writes)
            results = self._executed(values, lambda _: tuple(raw(i) for i in writes), before)
            self._results[known] = found = [(ANY_VALUE,) * len(writes)] if results is None else list(results)
        made = []
        for result in found:
            new = list(values)
            for i, value in zip(self._writes, result, strict=True):
                new[i] = value
            made.append(tuple(new))
        return made

    def _executed(self, values: Values, result_of: Callable[[Any], Any], failed: Any) -> dict[Any, None] | None:
        """Return the results of all ways through the block; None if nothing is known of them.

        Args:
            values: of the variables.
            result_of: returns the result, from what the block returns.
            failed: result if the block raises.
        """
        slots, choices, context = self._world.slots, self._world.choices, self._world.context
        results: dict[Any, None] = {}
        if self._call is None:
            return None
        for count, _ in enumerate(choices.executions()):
            if count == MAX_WAYS:
                return None
            context.work = MAX_WORK
            for i in self._reads:
                slots[i] = values[i]
            try:
                results[result_of(self._call(context))] = None
            except Exception:
                if choices.is_used:
                    return None
                results[failed] = None
        return results
