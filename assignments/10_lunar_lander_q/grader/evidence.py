"""Evidence of lab 10's grader: the transitions that a student's program reported, and the table learned from them.

From the states, actions and rewards of a training it learns a table of its own, which begins empty, and explores with
its own random numbers; that table flies the lander. The program is asked only which state an observation belongs to.
At the end two things are compared: the table that the student's update() made of the same transitions, and what
encode() returns for the same observations in a process that has seen neither training nor flight.
"""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Iterable
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from snr_sim.grading.lab.verdicts import Misbehaved
from snr_sim.learning.vertical_batch import Floats

from .pilot import ACTIONS, MOST_STATES, MOST_WORTH, RESIZED, Table, states_of
from .q_rule import Ledger, Step

ALIKE = 1e-6  # of the largest value: rounding in sums of another order is far less, one transition left out far more
# What is learned keeps moving to and fro, and the mean over some dozens of steps does not. Of 337 trainings of the
# reference (40 000 steps each) three ended with a table that lands fewer than 80 of 100; of 322 by the mean, none.
MEAN_EVERY, MEAN_FOLLOWS = 5, 0.125
ASKED_AGAIN = 3000  # observations of a training: faking one in a hundred passes with a probability of 1e-13
Change = tuple[int, int, float, int]  # state, action, and its new value and visits


class Rows(msgspec.Struct):
    """A table received from the student's process."""

    values: list[list[float]]
    visits: list[list[int]]


class Evidence:
    """What was reported in the training of a student's file, and what was learned from it here.

    Args:
        student: its file, by `Student.host` or `learning.Here`.
        seed: of the random numbers in exploration.

    Raises:
        Misbehaved: its number of states is not valid.
    """

    def __init__(self, student: Any, seed: int) -> None:
        self._student = student
        self.states = count_of(student)
        self.ledger = Ledger(self.states)
        self._rng = np.random.default_rng([seed, 4])
        self._trained: list[tuple[Floats, list[int]]] = []  # observations and their states, in training
        self._flown: list[tuple[Floats, list[int]]] = []
        self._steps = 0
        self._mean: Floats = np.zeros((self.states, ACTIONS))
        self._is_tried = np.zeros((self.states, ACTIONS), bool)

    def learn(self, transitions: Iterable[Step]) -> None:
        """Learn from transitions, one after the other; the mean follows, from the first value of what is new."""
        self.ledger.learn(transitions)
        self._steps += 1
        if self._steps % MEAN_EVERY == 0:
            self._mean += np.where(self._is_tried, MEAN_FOLLOWS, 1.0) * (np.array(self.ledger.values) - self._mean)
            self._is_tried = np.array(self.ledger.visits) > 0

    def choose(self, told: Floats, states: list[int], epsilon: float) -> NDArray[np.intp]:
        """Return the actions to try in these reported states: the best, or with probability epsilon a random one."""
        self._trained.append((told, states))
        drawn = self._rng.integers(ACTIONS, size=len(states))
        return np.where(self._rng.random(len(states)) < epsilon, drawn, self.ledger.greedy(states))

    def states_at(self, told: Floats) -> list[int]:
        """Return the states of observations, as the program reports them; in the end all of them are asked again."""
        states = self._asked(self._student, told)
        self._flown.append((told, states))
        return states

    def rows(self) -> tuple[Floats, NDArray[np.int64]]:
        """Return the mean of what the actions were worth, and which of them were tried (1, else 0)."""
        return self._mean, self._is_tried.astype(np.int64)

    def check_update(self) -> None:
        """Compare the result of the student's update() with what was learned here from the same transitions.

        Raises:
            Misbehaved: they differ.
        """
        theirs, ours = table_of(self._student.ask("learned", returns=Rows), self.states), self.ledger
        largest = max((abs(value) for row in ours.values for value in row), default=0.0)
        place = ours.differs(theirs, ALIKE * max(1.0, largest))
        if place is not None:
            state, action = place
            raise Misbehaved(
                "update() has made another table of the training than its transitions make.",
                "Each transition moves one value, by the rule of the README, the thousandth like the first. What does "
                "update() keep in between, or leave out?",
                f"values[{state}][{action}] = {ours.values[state][action]:.6g} "
                f"after {ours.visits[state][action]} visits",
                f"{theirs.values[state][action]:.6g} after {theirs.visits[state][action]}",
            )

    def check_states(self, fresh: Any) -> None:
        """Ask again, in another order, for the states of observations: all used in flight, and some of the training.

        Args:
            fresh: the same file, in a process that has seen nothing yet.

        Raises:
            Misbehaved: encode() depends on something else than its two numbers.
        """
        told, states = _joined(self._trained)
        which = self._rng.choice(len(states), min(ASKED_AGAIN, len(states)), replace=False)
        told, states = _joined([(told[which], states[which]), *self._flown])
        order = self._rng.permutation(len(states))
        for i, state in zip(order.tolist(), self._asked(fresh, told[order]), strict=True):
            if state != states[i]:
                height_m, speed_mps = told[i].tolist()
                raise Misbehaved(
                    f"encode({height_m:g}, {speed_mps:g}) returned {states[i]} once, and {state} in another run.",
                    "encode() must go by its two numbers alone: what does it keep from call to call, or draw?",
                )

    def _asked(self, student: Any, told: Floats) -> list[int]:
        return checked_states(student.ask("see", packed(told.T), returns=str), len(told), self.states)


def _joined(parts: Iterable[tuple[Floats, Any]]) -> tuple[Floats, NDArray[np.intp]]:
    """Return observations and their states, all in a row."""
    told, states = zip(*parts, strict=True)
    return np.concatenate(told), np.concatenate(states)


def count_of(student: Any) -> int:
    """Return how many states a student's file has; raise Misbehaved if the number is not valid."""
    count: int = student.ask("count", returns=int)
    if not 1 <= count <= MOST_STATES:
        raise Misbehaved(f"STATES is {count}.", f"Make it a whole number from 1 to {MOST_STATES}.")
    return count


def table_of(rows: Rows, states: int) -> Table:
    """Return the table received; raise Misbehaved if its number of rows differs."""
    if any([len(row) for row in each] != [ACTIONS] * states for each in (rows.values, rows.visits)):
        raise _resized()
    table = Table(0)
    table.values, table.visits = rows.values, rows.visits
    return table


def changed(table: Table, changes: Iterable[Change]) -> Table:
    """Return a table with changes applied; raise Misbehaved if one is outside the table."""
    for state, action, value, visits in changes:
        if not (0 <= state < len(table.values) and 0 <= action < ACTIONS):
            raise _resized()
        table.values[state][action], table.visits[state][action] = value, visits
    return table


def _resized() -> Misbehaved:
    return Misbehaved(RESIZED, "Change numbers that stand in the table: no append.")


def checked_states(answer: str, count: int, most: int) -> list[int]:
    """Return states received; raise Misbehaved if their number is wrong, or not all of them are states."""
    try:
        states = states_of(answer)
    except ValueError:
        states = []
    if len(states) != count or (states and max(states) >= most):
        raise Misbehaved("It did not tell a state for each observation.", "Leave alone what asks encode().")
    return states


def checked_rewards(answer: str, count: int) -> list[float]:
    """Return rewards received; raise Misbehaved if their number is wrong, or not all of them are valid numbers."""
    try:
        rewards = np.frombuffer(b64decode(answer))
    except ValueError:
        rewards = np.empty(0)
    if len(rewards) != count or not (np.abs(rewards) <= MOST_WORTH).all():
        raise Misbehaved("It did not tell a reward for each step.", "Leave alone what asks reward().")
    worths: list[float] = rewards.tolist()
    return worths


def packed(*rows: Floats) -> str:
    """Return rows of numbers as a text, for `pilot.rows_of`."""
    return b64encode(np.vstack(rows).tobytes()).decode()
