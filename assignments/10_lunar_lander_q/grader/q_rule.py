"""The grader's own table in lab 10: Q-learning as it should come out, and which mistake makes it come out otherwise.

The student's program reports states and rewards; what is learned from them the grader keeps here, and flies by it. So
what was not learned lands nothing, and replacing a function in the student's process gains nothing. The rule is not
`snr_sim.learning.tabular`'s: the step falls with the visits of each action, and lists are fast where single numbers are
read and written. A training of 80 000 transitions takes 0.02 s of CPU time; with its `TabularLearner` it took 0.33 s.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from .pilot import ACTIONS, Table, Transition

DISCOUNT, MIN_STEP_SIZE = 0.95, 0.02
Step = tuple[int, int, float, int, bool, bool]  # as a Transition


class ReferenceTable(Table):
    """A table that is learned by the rule of the lab, and knows the best action of each state.

    Args:
        states: how many rows.
        given: what it begins with; else nothing was tried.

    Attributes:
        best: of each state, the first of the best actions that were tried; 0 if none was.
        best_value: of each state, what that action is worth; 0 if none was tried.
    """

    def __init__(self, states: int, given: Table | None = None) -> None:
        super().__init__(states)
        self.best, self.best_value = [0] * states, [0.0] * states
        if given is not None:
            self.values, self.visits = ([list(row) for row in rows] for rows in (given.values, given.visits))
            for state in range(states):
                self._find_best(state)

    def learn(self, transitions: Iterable[Step]) -> None:
        """Learn from transitions, one after the other."""
        values, visits, best, best_value = self.values, self.visits, self.best, self.best_value
        for state, action, reward, next_state, is_terminated, _ in transitions:
            row, tries = values[state], visits[state]
            tries[action] = count = tries[action] + 1
            goal = reward if is_terminated else reward + DISCOUNT * best_value[next_state]
            old = row[action]
            row[action] = new = old + step_size_of(count) * (goal - old)
            if count > 1 and action == best[state] and new >= old:
                best_value[state] = new
            elif count == 1 or action == best[state] or new >= best_value[state]:
                self._find_best(state)

    def greedy(self, states: Iterable[int]) -> NDArray[np.intp]:
        """Return the best action of each of these states."""
        best = self.best
        return np.array([best[state] for state in states], np.intp)

    def differs(self, other: Table, within: float = 1e-9) -> tuple[int, int] | None:
        """Return state and action where a table of the same shape first differs; None if it does not."""
        for state, (mine, others) in enumerate(zip(self.visits, other.visits, strict=True)):
            for action, (one, two) in enumerate(zip(self.values[state], other.values[state], strict=True)):
                if mine[action] != others[action] or not abs(one - two) <= within:
                    return state, action
        return None

    def _find_best(self, state: int) -> None:
        row, tries = self.values[state], self.visits[state]
        best, best_value = 0, -math.inf
        for action in range(ACTIONS):
            if tries[action] and row[action] > best_value:
                best, best_value = action, row[action]
        self.best[state], self.best_value[state] = best, best_value if any(tries) else 0.0


def step_size_of(visits: int) -> float:
    """Return by which fraction a value moves at a visit; the first is 1."""
    size = 1.0 / visits
    return size if size > MIN_STEP_SIZE else MIN_STEP_SIZE


def choice_error(table: ReferenceTable, state: int, action: int) -> str:
    """Return the error for an action that is not the best."""
    if not any(table.visits[state]):
        return "Where nothing was tried yet, take action 0, the first."
    if not table.visits[state][action]:
        return "It takes an action that was never tried: its 0 was not learned. Choose among those with visits."
    if table.values[state][action] == table.best_value[state]:
        return "Two actions have the same value: take the first of them, so that results can be repeated."
    return "That is not the action with the highest value in this row of the table."


def diagnosis(before: ReferenceTable, step: Transition, right: Table, now: Table) -> str:
    """Return which mistake makes such a table of one transition."""
    old, new = before.values[step.state][step.action], now.values[step.state][step.action]
    changed = {
        (state, action)
        for state, rows in enumerate(zip(before.values, now.values, strict=True))
        for action, (a, b) in enumerate(zip(*rows, strict=True))
        if a != b
    }
    if not changed and before.visits == now.visits:
        return "update() changes nothing: move values[state][action] towards its target, and count the visit."
    if changed and step.state != step.next_state and all(state == step.next_state for state, _ in changed):
        return "It changes the row of the next state. Change the row of the state in which the action was taken."
    if changed - {(step.state, step.action)}:
        return "It changes more than values[state][action]."
    if now.visits != right.visits:
        return "Count the visit: visits[state][action] grows by 1, and nothing else."
    visits = right.visits[step.state][step.action]
    size, max_value, best_value = (
        step_size_of(visits),
        max(before.values[step.next_state]),
        before.best_value[step.next_state],
    )

    def is_from(towards: float) -> bool:
        return abs(old + size * (towards - old) - new) <= 1e-9

    if step.is_terminated and (
        is_from(step.reward + DISCOUNT * best_value) or is_from(step.reward + DISCOUNT * max_value)
    ):
        return "After a touchdown there is no next state: with is_terminated, do not add its value."
    if step.is_truncated and is_from(step.reward):
        return "is_truncated means only that the time limit was reached: add the value of the next state."
    if visits == 1 and step.state == step.next_state and is_from(step.reward + DISCOUNT * max(best_value, 0.0)):
        return (
            "The next state is the same state, and the action is new: its 0 was not learned. Read the value of the "
            "next state before you count the visit."
        )
    if is_from(step.reward + DISCOUNT * max_value):
        return "The best value of the next state includes actions that were never tried: their 0 was not learned."
    if is_from(step.reward + best_value):
        return "The next state's value is not discounted: multiply it by DISCOUNT."
    towards = step.reward + (0.0 if step.is_terminated else DISCOUNT * best_value)
    moved = (new - old) / (towards - old) if towards != old else 0.0
    if 0.0 <= moved < size:
        return (
            f"At visit {visits} the step size is {moved:.2g}, not {size:.2g}: a step size that falls so soon stops "
            "learning. It is 1 / visits, and never less than MIN_STEP_SIZE."
        )
    if size < moved <= 1.0:
        return f"At visit {visits} the step size is {moved:.2g}, not {size:.2g}: 1 / visits."
    return "Move the value by the step size towards reward + DISCOUNT * (best tried value of the next state)."
