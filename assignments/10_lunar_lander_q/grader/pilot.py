"""The student's side of lab 10: asks the functions of a file for many landers at a time, and keeps their table.

It runs in the student's process, alone, and calls the file's functions there. Only the grader's process knows the
landers, their number, starts, actions and results (`learning.py`); it keeps a table of its own, too
(`evidence.py`), and only compares this one with it at the end. So replacing anything in here gains nothing.
"""

from __future__ import annotations

import math
import random
from array import array
from base64 import b64decode, b64encode
from collections.abc import Iterable, Iterator, Sequence
from numbers import Integral, Real
from types import ModuleType
from typing import Any, NamedTuple

from snr_sim.errors import ParameterError

ACTIONS = 4
MAX_STATES = 5000  # two bytes each in a message
MAX_REWARD = 1e9
LANDED, CRASHED, TIMEOUT = "landed", "crashed", "timeout"
RESIZED = "update() has made the table larger or smaller."


class Transition(NamedTuple):
    """One step of one lander, as `update` gets it.

    Args:
        state, action, reward: the state, the action taken there, and its reward.
        next_state: the state after it.
        is_terminated: it has touched the ground: the last one of its episode.
        is_truncated: the time limit ended the episode.
    """

    state: int
    action: int
    reward: float
    next_state: int
    is_terminated: bool
    is_truncated: bool


class Table:
    """What has been learned: `values[state][action]`, and how often each was tried, `visits[state][action]`."""

    def __init__(self, states: int) -> None:
        self.values = [[0.0] * ACTIONS for _ in range(states)]
        self.visits = [[0] * ACTIONS for _ in range(states)]

    def plain(self) -> dict[str, Any]:
        """Return it as lists, as it crosses to the grader."""
        return {"values": self.values, "visits": self.visits}

    @classmethod
    def of(cls, plain: dict[str, Any]) -> Table:
        """Return a new table from such lists."""
        table = cls(0)
        table.values, table.visits = ([list(row) for row in plain[name]] for name in ("values", "visits"))
        return table

    def differences(self, before: Table) -> Iterator[tuple[int, int, float, int]]:
        """Yield state, action, value and visits of each place that is not as it was before.

        Raises:
            ParameterError: it has another shape.
        """
        try:
            for state, rows in enumerate(zip(self.values, self.visits, before.values, before.visits, strict=True)):
                if rows[:2] != rows[2:]:
                    for action, (value, visits, *was) in enumerate(zip(*rows, strict=True)):
                        if [value, visits] != was:
                            yield state, action, value, visits
        except ValueError:
            raise ParameterError(RESIZED, fix="change numbers in it; do not append.") from None


class StudentPolicy:
    """The functions of a student's file, for many landers at once.

    Raises:
        ParameterError: one of them is missing, or STATES is not a sensible number; or, in any method, a function of
            the file has returned what it should not.
    """

    def __init__(self, module: ModuleType) -> None:
        for name in ("encode", "reward", "epsilon", "choose", "update"):
            if not callable(getattr(module, name, None)):
                raise ParameterError(f"The file has no function {name}().", fix="keep all that the starter has.")
        states = to_python_int(getattr(module, "STATES", None))
        if type(states) is not int or not 1 <= states <= MAX_STATES:
            raise ParameterError(
                f"STATES is {states!r}.",
                fix=f"a whole number from 1 to {MAX_STATES}: how many different numbers encode() returns.",
            )
        self.module: Any = module
        self.states = states
        self.begin(0)

    def count(self) -> int:
        """Return how many states there are."""
        return self.states

    def begin(self, seed: int) -> None:
        """Forget everything, and begin to learn."""
        self.rng = random.Random(seed)
        self.table = Table(self.states)
        self._here: list[int] = []
        self._truth: list[tuple[float, float]] = []

    def encode(self, heights_m: Sequence[float], speeds_mps: Sequence[float]) -> list[int]:
        """Return the states of many observations."""
        encode, count, found = self.module.encode, self.states, []
        for height_m, speed_mps in zip(heights_m, speeds_mps, strict=True):
            state = to_python_int(encode(height_m, speed_mps))
            if type(state) is not int or not 0 <= state < count:
                raise ParameterError(
                    f"encode({height_m:g}, {speed_mps:g}) returned {state!r}.",
                    fix=f"a whole number from 0 to STATES - 1, which is {count - 1}.",
                )
            found.append(state)
        return found

    def encode_packed(self, packed: str) -> str:
        """Return the states of many observations, packed."""
        return packed_states(self.encode(*rows_of(packed, 2)))

    def learn(self, share: float, packed: str, ends: Sequence[Sequence[Any]], done: str) -> dict[str, Any]:
        """Learn from the results of the last actions; return where that led and what it was worth.

        Args:
            share: how much of the training is over, 0 to 1.
            packed: of all landers, one that has ended has begun again: heights and speeds as the radar measures them,
                heights and speeds as they are; and propellant of the last step, but not at first, when there is
                nothing to learn from.
            ends: of landers whose episode has ended: which, its last height and speed, and the outcome.
            done: the last actions, a digit each; none at first.

        Returns:
            states of all, states in which episodes have ended, rewards of the last actions, and epsilon.
        """
        update, table = self.module.update, self.table
        measured_m, measured_mps, heights_m, speeds_mps, *burned = rows_of(packed, 5 if done else 4)
        now, here = self.encode(measured_m, measured_mps), list(zip(heights_m, speeds_mps, strict=True))
        last, reward_values = self.encode([end[1] for end in ends], [end[2] for end in ends]), array("d")
        if done:
            then, after, outcomes = list(now), list(here), [""] * len(now)
            for (i, height_m, speed_mps, outcome), state in zip(ends, last, strict=True):
                then[i], after[i], outcomes[i] = state, (height_m, speed_mps), outcome
            reward_values = self._rewards(zip(self._truth, after, burned[0], outcomes, strict=True))
            for state, action, reward_value, next_state, outcome in zip(
                self._here, map(int, done), reward_values, then, outcomes, strict=True
            ):
                is_truncated = outcome == TIMEOUT
                is_terminated = outcome != "" and not is_truncated
                update(table, Transition(state, action, reward_value, next_state, is_terminated, is_truncated))
        self._here, self._truth = now, here
        rewards = b64encode(reward_values.tobytes()).decode()
        return {"states": packed_states(now), "last": last, "rewards": rewards, "epsilon": self._epsilon(share)}

    def _rewards(self, steps: Iterable[tuple[Any, Any, float, str]]) -> array[float]:
        reward, reward_values = self.module.reward, array("d")
        for before, after, burned_kg, outcome in steps:
            reward_value = reward(*before, *after, burned_kg, outcome)
            try:
                reward_values.append(reward_value)
                is_number = -MAX_REWARD <= reward_value <= MAX_REWARD
            except TypeError:
                is_number = False
            if not is_number:
                raise ParameterError(
                    f"reward() returned {reward_value!r}.",
                    fix=f"a number from {-MAX_REWARD:g} to {MAX_REWARD:g}, always.",
                )
        return reward_values

    def _epsilon(self, share: float) -> float:
        epsilon = self.module.epsilon(share)
        if not isinstance(epsilon, Real) or not math.isfinite(epsilon):
            raise ParameterError(f"epsilon({share:g}) returned {epsilon!r}.", fix="a number from 0 to 1.")
        return float(epsilon)

    def choose(self, states: Sequence[int], epsilon: float) -> list[int]:
        """Return the actions that choose() selects in states, from the table learned."""
        choose, table, rng = self.module.choose, self.table, self.rng
        actions = [to_python_int(choose(table, state, epsilon, rng)) for state in states]
        for action in actions:
            if type(action) is not int or not 0 <= action < ACTIONS:
                raise ParameterError(f"choose() returned {action!r}.", fix=f"a whole number from 0 to {ACTIONS - 1}.")
        return actions

    def choices(self, plain: dict[str, Any], states: Sequence[int], epsilon: float, seed: int) -> dict[str, Any]:
        """Return what is chosen in states of a given table, and the table afterwards."""
        self.table, self.rng = Table.of(plain), random.Random(seed)
        return {"actions": self.choose(states, epsilon), "table": self.table.plain()}

    def table_rows(self) -> dict[str, Any]:
        """Return the table."""
        return self.table.plain()

    def replay(self, plain: dict[str, Any], transitions: Sequence[Sequence[Any]]) -> dict[str, Any]:
        """Return a given table after some transitions."""
        table = Table.of(plain)
        for one in transitions:
            self.module.update(table, Transition(*one))
        return table.plain()

    def replay_each(self, plain: dict[str, Any], transitions: Sequence[Sequence[Any]]) -> list[list[tuple[Any, ...]]]:
        """Return of each of some transitions what it alone changes in a given table, as `Table.differences`."""
        before = Table.of(plain)
        return [list(Table.of(self.replay(plain, [one])).differences(before)) for one in transitions]


def to_python_int(value: Any) -> Any:
    """Return a NumPy integer as a Python int, and any other value unchanged: 7.0 and True, too."""
    is_foreign = type(value) is not int and isinstance(value, Integral) and not isinstance(value, bool)
    return int(value) if is_foreign else value


def rows_of(packed: str, count: int) -> list[list[float]]:
    """Return rows of numbers that were sent as the bytes of doubles, in base64; as JSON they cost three times this."""
    numbers = array("d", b64decode(packed)).tolist()
    each = len(numbers) // count
    return [numbers[i * each : (i + 1) * each] for i in range(count)]


def packed_states(states: Sequence[int]) -> str:
    """Return states as a text, for `states_of`."""
    return b64encode(array("H", states).tobytes()).decode()


def states_of(packed: str) -> list[int]:
    """Return states that were sent by `packed_states`.

    Raises:
        ValueError: they were not.
    """
    return array("H", b64decode(packed)).tolist()
