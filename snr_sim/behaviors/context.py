"""What the functions of a machine get: readings, variables, time in the state, the values of a signal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from snr_sim.prelude.errors import ConfigError, ParameterError, UnknownNameError, suggest
from snr_sim.prelude.task import DataKey, Page, Task, TaskType

if TYPE_CHECKING:
    import numpy as np

NS_PER_MS, NS_PER_S = 1_000_000, 1_000_000_000
MAX_CHAIN = 16  # transitions of one machine in one step
MAX_SIZE = 1000  # elements of a value at all depths; four characters of a text count as one
MAX_DEPTH = 20  # of tuples in tuples
_MIN_INT, _MAX_INT = -(2**63), 2**63 - 1
MAX_WORK = 150_000  # of the blocks of a step: 35 ms at most, of 380 hostile blocks; see block_bounds.py


class Owner(Protocol):
    """What an interpreter needs of the component that it belongs to."""

    def get_data(self, key: DataKey) -> Any:
        """Return the data of the newest page of a key, or None."""

    def get_age_s(self, key: DataKey) -> float:
        """Return the age of that page [s]; infinite without one."""

    def store_data_task(self, key: DataKey, data: Any, process: bool = True) -> Task:
        """Return the task that stores data under a key."""


class FixedPages:
    """Pages for an interpreter outside a node: data by key, each of age 0. Implements Owner."""

    def __init__(self, pages: Mapping[DataKey, Any]) -> None:
        self.pages: Mapping[DataKey, Any] = pages

    def get_data(self, key: DataKey) -> Any:
        """Return the data of a key, or None."""
        return self.pages.get(key)

    def get_age_s(self, key: DataKey) -> float:
        """Return 0, or infinity if there is no such page."""
        return 0.0 if key in self.pages else math.inf

    def store_data_task(self, key: DataKey, data: Any, process: bool = True) -> Task:
        """Return the task that stores data under a key, of a node without name at time 0."""
        return Task(TaskType.store_page, key, [Page(key, data, "", 0.0, process)])


class Variables(MutableMapping[str, Any]):
    """Variables that one machine sees: its own, and those of the machines around it.

    Args:
        slots: the values of all variables of a program.
        index: place in them by name.
    """

    def __init__(self, slots: list[Any], index: Mapping[str, int]) -> None:
        self._slots = slots
        self._index = index

    def __getitem__(self, name: str) -> Any:
        return self._slots[self.place(name)]

    def __setitem__(self, name: str, value: Any) -> None:
        self._slots[self.place(name)] = plain_value(name, value)

    def __delitem__(self, name: str) -> None:
        raise ParameterError(f"The variable '{name}' cannot be deleted.", fix="set it to None.")

    def __iter__(self) -> Iterator[str]:
        return iter(self._index)

    def __len__(self) -> int:
        return len(self._index)

    def place(self, name: str) -> int:
        """Return the index of a variable's value.

        Raises:
            UnknownNameError: no variable of that name can be seen here.
        """
        place = self._index.get(name)
        if place is None:
            raise UnknownNameError(
                f"There is no variable '{name}' in this machine.", fix=suggest(name, self._index, "declared are")
            )
        return place


class MachineContext:
    """What the functions of a program are called with.

    Args:
        owner: the component whose pages are read.

    Attributes:
        data: returns the data of the newest page of a key, or None.
        age_s: returns the age of that page [s]; infinite without one.
        store_data_task: returns the task that stores data under a key, for a block to return.
        now_ns: time of the step.
        signal: the values of the signal that caused the step.
    """

    def __init__(self, owner: Owner, rng: np.random.Generator | None = None) -> None:
        self.data: Callable[[DataKey], Any] = owner.get_data
        self.age_s: Callable[[DataKey], float] = owner.get_age_s
        self.store_data_task: Callable[..., Task] = owner.store_data_task
        self._rng = rng
        self.machine: Any = None  # the one whose block is executed
        self.now_ns: int = 0
        self.signal: Sequence[Any] = ()
        self.work: int = MAX_WORK  # that blocks may still do in this step: see `block_bounds.py`
        self.logged: list[str] = []  # in this step

    @property
    def variables(self) -> Variables:
        """The variables that the machine sees, by name."""
        seen: Variables = self.machine.variables
        return seen

    @property
    def in_state_s(self) -> float:
        """Time since the machine entered its state [s]."""
        since_ns: int = self.machine.since_ns
        return (self.now_ns - since_ns) / NS_PER_S

    @property
    def in_state_ms(self) -> float:
        """Time since the machine entered its state [ms]."""
        return 1000.0 * self.in_state_s

    def random(self) -> float:
        """Return a random number from 0 to 1."""
        return float(self.rng.random())

    def log(self, text: object) -> None:
        """Log a text, of which 1000 characters are kept, at most 100 times in a step."""
        if len(self.logged) < 100:
            self.logged.append(str(text)[:1000])

    @property
    def has_no_rng(self) -> bool:
        """Whether the interpreter was given no random generator."""
        return self._rng is None

    @property
    def rng(self) -> np.random.Generator:
        """The random generator of the component.

        Raises:
            ConfigError: the interpreter was given none.
        """
        if self._rng is None:
            raise ConfigError("This interpreter has no random generator.", fix="Interpreter(program, rng=...).")
        return self._rng


def plain_value(name: str, value: Any) -> Any:
    """Return a value as a variable keeps it: a number, text, True, False, None, or a tuple of these, also for a list.

    Raises:
        ParameterError: it is another value, or larger than what pages should carry: see the constants above.
    """
    kind = type(value)
    if kind is float or value is None or kind is bool or (kind is int and _MIN_INT <= value <= _MAX_INT):
        return value
    if kind in (str, list, tuple):
        if size_of(value) <= MAX_SIZE:
            return value if kind is str else _plain_tuple(name, value, MAX_DEPTH)
        raise ParameterError(
            f"The variable '{name}' has more than {MAX_SIZE} elements, or {4 * MAX_SIZE} characters.",
            fix="keep long data in a page.",
        )
    raise ParameterError(
        f"The variable '{name}' cannot be {_short(value)}.",
        fix="numbers of 64 bits, text, True, False, None, or tuples of these.",
    )


def _plain_tuple(name: str, values: Any, depth: int) -> tuple[Any, ...]:
    if depth == 0:
        raise ParameterError(
            f"The variable '{name}' has more than {MAX_DEPTH} levels.", fix="keep long data in a page."
        )
    return tuple(
        _plain_tuple(name, one, depth - 1) if type(one) in (list, tuple) else plain_value(name, one) for one in values
    )


def size_of(value: Any) -> int:
    """Return the number of elements of a value at all depths; of a large one, some number above `MAX_SIZE`."""
    if type(value) is str:
        return len(value) // 4
    count, inside = 0, [value] if type(value) in (tuple, list) else []
    while inside and count <= MAX_SIZE:
        one = inside.pop()
        count += len(one)
        for child in one:
            kind = type(child)
            if kind is str:
                count += len(child) // 4
            elif kind is tuple or kind is list:
                inside.append(child)
    return count


def _short(value: Any) -> str:
    return "an integer of more than 64 bits" if type(value) is int else f"a {type(value).__name__}"
