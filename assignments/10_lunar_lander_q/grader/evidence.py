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

from snr_sim.grading import SubmissionError
from snr_sim.learning.vertical_batch import Floats

from .pilot import ACTIONS, MAX_REWARD, MAX_STATES, RESIZED, Table, states_of
from .q_rule import ReferenceTable, Step

ALIKE = 1e-6  # of the largest value: rounding in sums of another order is far less, one transition left out far more
# What is learned keeps moving to and fro, and the mean over some dozens of steps does not. Of 337 trainings of the
# reference (40 000 steps each) three ended with a table that lands fewer than 80 of 100; of 322 by the mean, none.
MEAN_INTERVAL, MEAN_FOLLOWS = 5, 0.125
ASKED_AGAIN = 3000  # observations of a training: faking one in a hundred passes with a probability of 1e-13
Change = tuple[int, int, float, int]  # state, action, and its new value and visits


class Rows(msgspec.Struct):
    """A table received from the student's process."""

    values: list[list[float]]
    visits: list[list[int]]


class Evidence:
    """What was reported in the training of a student's file, and what was learned from it here.

    Args:
        student: its file, by `Student.create_object` or `learning.LocalSubmission`.
        seed: of the random numbers in exploration.

    Raises:
        SubmissionError: its number of states is not valid.
    """

    def __init__(self, student: Any, seed: int) -> None:
        self._student = student
        self.states = count_of(student)
        self.reference = ReferenceTable(self.states)
        self._rng = np.random.default_rng([seed, 4])
        self._training_observations: list[tuple[Floats, list[int]]] = []  # observations and their states, in training
        self._flight_observations: list[tuple[Floats, list[int]]] = []
        self._steps = 0
        self._mean: Floats = np.zeros((self.states, ACTIONS))
        self._is_tried = np.zeros((self.states, ACTIONS), bool)

    def learn(self, transitions: Iterable[Step]) -> None:
        """Learn from transitions, one after the other; the mean follows, from the first value of what is new."""
        self.reference.learn(transitions)
        self._steps += 1
        if self._steps % MEAN_INTERVAL == 0:
            self._mean += np.where(self._is_tried, MEAN_FOLLOWS, 1.0) * (np.array(self.reference.values) - self._mean)
            self._is_tried = np.array(self.reference.visits) > 0

    def choose(self, observations: Floats, states: list[int], epsilon: float) -> NDArray[np.intp]:
        """Return the actions to try in these reported states: the best, or with probability epsilon a random one."""
        self._training_observations.append((observations, states))
        drawn = self._rng.integers(ACTIONS, size=len(states))
        return np.where(self._rng.random(len(states)) < epsilon, drawn, self.reference.greedy(states))

    def states_at(self, observations: Floats) -> list[int]:
        """Return the states of observations, as the program reports them; in the end all of them are asked again."""
        states = self._asked(self._student, observations)
        self._flight_observations.append((observations, states))
        return states

    def rows(self) -> tuple[Floats, NDArray[np.int64]]:
        """Return the mean of what the actions were worth, and which of them were tried (1, else 0)."""
        return self._mean, self._is_tried.astype(np.int64)

    def check_update(self) -> None:
        """Compare the result of the student's update() with what was learned here from the same transitions.

        Raises:
            SubmissionError: they differ.
        """
        theirs, ours = table_of(self._student.ask("table_rows", returns=Rows), self.states), self.reference
        largest = max((abs(value) for row in ours.values for value in row), default=0.0)
        place = ours.differs(theirs, ALIKE * max(1.0, largest))
        if place is not None:
            state, action = place
            raise SubmissionError(
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
            SubmissionError: encode() depends on something else than its two numbers.
        """
        observations, states = _joined(self._training_observations)
        which = self._rng.choice(len(states), min(ASKED_AGAIN, len(states)), replace=False)
        observations, states = _joined([(observations[which], states[which]), *self._flight_observations])
        order = self._rng.permutation(len(states))
        for i, state in zip(order.tolist(), self._asked(fresh, observations[order]), strict=True):
            if state != states[i]:
                height_m, speed_mps = observations[i].tolist()
                raise SubmissionError(
                    f"encode({height_m:g}, {speed_mps:g}) returned {states[i]} once, and {state} in another run.",
                    "encode() must depend on its two arguments alone: what does it keep from call to call, or draw?",
                )

    def _asked(self, student: Any, observations: Floats) -> list[int]:
        return parse_states(
            student.ask("encode_packed", pack_rows(observations.T), returns=str), len(observations), self.states
        )


def _joined(parts: Iterable[tuple[Floats, Any]]) -> tuple[Floats, NDArray[np.intp]]:
    """Return observations and their states, all in a row."""
    observations, states = zip(*parts, strict=True)
    return np.concatenate(observations), np.concatenate(states)


def count_of(student: Any) -> int:
    """Return how many states a student's file has; raise SubmissionError if the number is not valid."""
    count: int = student.ask("count", returns=int)
    if not 1 <= count <= MAX_STATES:
        raise SubmissionError(f"STATES is {count}.", f"Make it a whole number from 1 to {MAX_STATES}.")
    return count


def table_of(rows: Rows, states: int) -> Table:
    """Return the table received; raise SubmissionError if its number of rows differs."""
    if any([len(row) for row in each] != [ACTIONS] * states for each in (rows.values, rows.visits)):
        raise _resized()
    table = Table(0)
    table.values, table.visits = rows.values, rows.visits
    return table


def apply_changes(table: Table, changes: Iterable[Change]) -> Table:
    """Return a table with changes applied; raise SubmissionError if one is outside the table."""
    for state, action, value, visits in changes:
        if not (0 <= state < len(table.values) and 0 <= action < ACTIONS):
            raise _resized()
        table.values[state][action], table.visits[state][action] = value, visits
    return table


def _resized() -> SubmissionError:
    return SubmissionError(RESIZED, "Change numbers in the table; do not append.")


def parse_states(answer: str, count: int, state_count: int) -> list[int]:
    """Return states received; raise SubmissionError if their number is wrong, or not all of them are states."""
    try:
        states = states_of(answer)
    except ValueError:
        states = []
    if len(states) != count or (states and max(states) >= state_count):
        raise SubmissionError(
            "It did not report a state for each observation.", "Do not modify the code that calls encode()."
        )
    return states


def parse_rewards(answer: str, count: int) -> list[float]:
    """Return rewards received; raise SubmissionError if their number is wrong, or not all of them are valid numbers."""
    try:
        rewards = np.frombuffer(b64decode(answer))
    except ValueError:
        rewards = np.empty(0)
    if len(rewards) != count or not (np.abs(rewards) <= MAX_REWARD).all():
        raise SubmissionError(
            "It did not report a reward for each step.", "Do not modify the code that calls reward()."
        )
    values: list[float] = rewards.tolist()
    return values


def pack_rows(*rows: Floats) -> str:
    """Return rows of numbers as a text, for `pilot.rows_of`."""
    return b64encode(np.vstack(rows).tobytes()).decode()
