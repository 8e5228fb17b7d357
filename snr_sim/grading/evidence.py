"""What the grader of lab 10 knows for itself: what a student's program has told, what was learned from it, who flies.

Of a training it has all evidence: states, actions, rewards, where they led. From these it learns a table of its own,
which begins empty, and explores by its own chance; what flies is that table. The program is asked only in which state
an observation is. In the end two things are compared: the table that the student's update() has made of the same
transitions, and what encode() says of the same observations in a process that has seen neither training nor flight.
"""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Iterable
from typing import Any, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from snr_sim.grading.lab.verdicts import Misbehaved
from snr_sim.grading.pilot import ACTIONS, MOST_STATES, MOST_WORTH, Table, states_of
from snr_sim.grading.q_rule import Ledger, Step
from snr_sim.learning.vertical_batch import Floats

ALIKE = 1e-6  # of the largest value: rounding in sums of another order is far less, one transition left out far more
# What is learned keeps moving to and fro, and the mean over some dozens of steps does not. Of 337 trainings of the
# reference (40 000 steps each) three ended with a table that lands fewer than 80 of 100; of 322 by the mean, none.
MEAN_EVERY, MEAN_FOLLOWS = 5, 0.125
ASKED_AGAIN = 3000  # observations of a training: who fakes one in a hundred is found, but for one in 1e13


class Asked(Protocol):
    """The student's file: in its own process, or in this one."""

    def ask(self, method: str, *args: Any, returns: Any = Any) -> Any:
        """Returns what a method of `Pilot` returns."""
        ...


class Rows(msgspec.Struct):
    """A table as it comes back."""

    values: list[list[float]]
    visits: list[list[int]]


Change = tuple[int, int, float, int]  # state, action, and what value and visits are now


class Told(msgspec.Struct):
    """What comes back of a step of training, as `Pilot.learn` says."""

    states: str
    last: list[int]
    rewards: str
    epsilon: float


class Evidence:
    """A student's file that is trained, as the grader sees it, and what was learned here.

    Args:
        student: its file.
        seed: of the chance in what is tried.

    Raises:
        Misbehaved: it has no sensible number of states.
    """

    def __init__(self, student: Asked, seed: int) -> None:
        self._student = student
        self.states = count_of(student)
        self.ledger = Ledger(self.states)
        self._chance = np.random.default_rng([seed, 4])
        self._trained: list[tuple[Floats, list[int]]] = []
        self._flown: list[tuple[Floats, list[int]]] = []
        self._steps = 0
        self._mean: Floats = np.zeros((self.states, ACTIONS))
        self._is_tried = np.zeros((self.states, ACTIONS), bool)

    def learn(self, transitions: Iterable[Step]) -> None:
        """Learns from transitions, one after the other."""
        self.ledger.learn(transitions)
        self._steps += 1
        if self._steps % MEAN_EVERY == 0:
            self._follow()

    def _follow(self) -> None:
        """Moves the mean towards what is known now; what was tried for the first time begins as it is."""
        follows = np.where(self._is_tried, MEAN_FOLLOWS, 1.0)
        self._mean += follows * (np.array(self.ledger.values) - self._mean)
        self._is_tried = np.array(self.ledger.visits) > 0

    def choose(self, told: Floats, states: list[int], epsilon: float) -> NDArray[np.intp]:
        """Returns what to try where these states were told: the best, or with probability epsilon any."""
        self._trained.append((told, states))
        chance = self._chance
        drawn = chance.integers(ACTIONS, size=len(states))
        return np.where(chance.random(len(states)) < epsilon, drawn, self.ledger.greedy(states))

    def states_at(self, told: Floats) -> list[int]:
        """Returns the states of observations, as the program tells them; in the end all of them are asked again."""
        states = checked_states(self._student.ask("see", packed(told.T), returns=str), len(told), self.states)
        self._flown.append((told, states))
        return states

    def rows(self) -> tuple[Floats, NDArray[np.int64]]:
        """Returns the mean of what the actions were worth, and which of them were tried (1, else 0)."""
        return self._mean, self._is_tried.astype(np.int64)

    def check_update(self) -> None:
        """Compares what the student's update() has made of the training with what was learned here.

        Raises:
            Misbehaved: it is not the same.
        """
        theirs = table_of(self._student.ask("learned", returns=Rows), self.states)
        largest = max((abs(value) for row in self.ledger.values for value in row), default=0.0)
        place = self.ledger.differs(theirs, ALIKE * max(1.0, largest))
        if place is not None:
            state, action = place
            visits, value = (
                [rows[state][action] for rows in pair]
                for pair in ((self.ledger.visits, theirs.visits), (self.ledger.values, theirs.values))
            )
            raise Misbehaved(
                "update() has made another table of the training than its transitions make.",
                "Each transition moves one value, by the rule of the README, the thousandth like the first. What does "
                "update() keep in between, or leave out?",
                f"values[{state}][{action}] = {value[0]:.6g} after {visits[0]} visits",
                f"{value[1]:.6g} after {visits[1]}",
            )

    def check_states(self, fresh: Asked) -> None:
        """Asks again, in another process and order, in which states observations are: all that it flies by, and some
        of those that it was trained with.

        Args:
            fresh: the same file, in a process that has seen nothing yet.

        Raises:
            Misbehaved: encode() does not go by its two numbers alone.
        """
        told, states = _joined(self._trained)
        which = self._chance.choice(len(states), min(ASKED_AGAIN, len(states)), replace=False)
        told, states = _joined([(told[which], states[which]), *self._flown])
        order = self._chance.permutation(len(states))
        again = checked_states(fresh.ask("see", packed(told[order].T), returns=str), len(order), self.states)
        for i, state in zip(order.tolist(), again, strict=True):
            if state != states[i]:
                height_m, speed_mps = told[i].tolist()
                raise Misbehaved(
                    f"encode({height_m:g}, {speed_mps:g}) returned {states[i]} once, and {state} in another run.",
                    "encode() must go by its two numbers alone: what does it keep from call to call, or draw?",
                )


def _joined(parts: Iterable[tuple[Floats, Any]]) -> tuple[Floats, NDArray[np.intp]]:
    """Returns observations and their states, all in a row."""
    told, states = zip(*parts, strict=True)
    return np.concatenate(told), np.concatenate(states)


def count_of(student: Asked) -> int:
    """Returns how many states a student's file has.

    Raises:
        Misbehaved: it is no sensible number.
    """
    count: int = student.ask("count", returns=int)
    if not 1 <= count <= MOST_STATES:
        raise Misbehaved(f"STATES is {count}.", f"Make it a whole number from 1 to {MOST_STATES}.")
    return count


def table_of(rows: Rows, states: int) -> Table:
    """Returns a table that came back.

    Raises:
        Misbehaved: it has other rows than it had.
    """
    if any([len(row) for row in each] != [ACTIONS] * states for each in (rows.values, rows.visits)):
        raise _resized()
    table = Table(0)
    table.values, table.visits = rows.values, rows.visits
    return table


def changed(table: Table, changes: Iterable[Change]) -> Table:
    """Returns a table, changed in some places.

    Raises:
        Misbehaved: it has no such place.
    """
    for state, action, value, visits in changes:
        if not (0 <= state < len(table.values) and 0 <= action < ACTIONS):
            raise _resized()
        table.values[state][action], table.visits[state][action] = value, visits
    return table


def _resized() -> Misbehaved:
    return Misbehaved(
        "update() has made the table larger or smaller.", "Change numbers that stand in the table: no append."
    )


def checked_states(answer: str, count: int, most: int) -> list[int]:
    """Returns states that were sent.

    Raises:
        Misbehaved: they are not so many, or not all of them are states.
    """
    try:
        states = states_of(answer)
    except ValueError:
        states = []
    if len(states) != count or (states and max(states) >= most):
        raise Misbehaved("It did not tell a state for each observation.", "Leave alone what asks encode().")
    return states


def checked_rewards(answer: str, count: int) -> list[float]:
    """Returns rewards that were sent.

    Raises:
        Misbehaved: they are not so many, or no sensible numbers.
    """
    try:
        rewards = np.frombuffer(b64decode(answer))
    except ValueError:
        rewards = np.empty(0)
    if len(rewards) != count or not (np.abs(rewards) <= MOST_WORTH).all():
        raise Misbehaved("It did not tell a reward for each step.", "Leave alone what asks reward().")
    worths: list[float] = rewards.tolist()
    return worths


def packed(*rows: Floats) -> str:
    """Returns rows of numbers as a text, for `pilot.rows_of`."""
    return b64encode(np.vstack(rows).tobytes()).decode()
