"""Learning a table by trying: Q-learning, SARSA and Expected SARSA, in any environment with a Discretiser for it.

All three move a value towards reward plus what is expected afterwards, and differ in what they expect:

    Q-learning       the best action's value                                      (Watkins 1989)
    SARSA            the value of the action that is really taken next           (Rummery, Niranjan 1994)
    Expected SARSA   the mean over what might be taken, by how likely it is      (van Seijen et al. 2009)

After a terminated episode nothing is expected. After a truncated one the world would have continued: something is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from snr_sim.learning.q_table import QTable
from snr_sim.learning.settings import check_finite, check_share, check_whole
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest

METHODS = ("q_learning", "sarsa", "expected_sarsa")


@dataclass(frozen=True)
class ExponentialSchedule:
    """A number that falls from one value to another, by a fixed factor per episode, and then stays.

    >>> epsilon = ExponentialSchedule(1.0, 0.1, episodes=100)
    >>> epsilon.at(0), round(epsilon.at(50), 3), epsilon.at(100), epsilon.at(1000)
    (1.0, 0.316, 0.1, 0.1)
    """

    first: float
    last: float
    episodes: int

    def __post_init__(self) -> None:
        is_none = self.first == self.last == 0.0
        if not ((is_none or 0.0 < self.last <= self.first <= 1.0) and self.episodes > 0):
            raise ParameterError(
                f"A decay from {self.first} to {self.last} in {self.episodes} episodes.",
                fix="numbers from 1 down to more than 0, in 1 episode or more; or from 0 to 0, which is never.",
            )

    def at(self, episode: int) -> float:
        """Return the value in an episode; the first one is 0."""
        if episode >= self.episodes or self.first == 0.0:
            return self.last
        fallen: float = self.first * (self.last / self.first) ** (episode / self.episodes)
        return fallen


@dataclass(frozen=True)
class Training:
    """Settings of the training of a table.

    Args:
        method: one of `METHODS`.
        discount: factor for a reward that comes a step later, 0 to 1.
        step: step size of an update.
        epsilon: probability of a random action.
        seed: of all random numbers in the training.
    """

    method: str = "q_learning"
    episodes: int = 1000
    discount: float = 1.0
    step: ExponentialSchedule = field(default_factory=lambda: ExponentialSchedule(0.2, 0.2, 1))
    epsilon: ExponentialSchedule = field(default_factory=lambda: ExponentialSchedule(1.0, 0.02, 500))
    seed: int = 0

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise UnknownNameError(f"There is no method '{self.method}'.", fix=suggest(self.method, METHODS))
        check_whole("episodes", self.episodes, min_value=0)
        check_whole("seed", self.seed, min_value=0)
        check_share("discount", self.discount)
        if self.step.last == 0.0:
            raise ParameterError(
                "A training with a step of 0, which learns nothing.", fix="ExponentialSchedule(0.2, 0.2, 1)"
            )


class TabularLearner:
    """Updates a table, transition by transition."""

    def __init__(self, table: QTable, training: Training) -> None:
        self.table: QTable = table
        self.training: Training = training
        self.rng: np.random.Generator = np.random.default_rng(training.seed)
        self.step: float = training.step.at(0)
        self.epsilon: float = training.epsilon.at(0)

    def choose(self, cell: int) -> int:
        """Return an action: the best one, or with probability epsilon any."""
        if self.rng.random() < self.epsilon:
            return int(self.rng.integers(len(self.table.actions)))
        return self.table.best(cell)

    def update(
        self, cell: int, action: int, reward: float, next_cell: int, next_action: int | None, is_terminated: bool
    ) -> float:
        """Learn from one transition; return by how much it was a surprise.

        Args:
            cell, action: the state, and the action taken.
            reward: for it.
            next_cell, next_action: the result, and the action to be taken there: only SARSA uses it, and for the
                others it is None, as they decide on it when they have learned.
            is_terminated: nothing comes after; not so if the episode was only cut off.

        Raises:
            ParameterError: the value is about to become infinite or NaN.
        """
        expected = 0.0 if is_terminated else self._expected(next_cell, next_action)
        td_error = reward + self.training.discount * expected - float(self.table.values[cell, action])
        check_finite(td_error, f"cell {cell}")
        self.table.values[cell, action] += self.step * td_error
        self.table.visits[cell, action] += 1
        return td_error

    def _expected(self, cell: int, action: int | None) -> float:
        values = self.table.values[cell]
        if self.training.method == "sarsa":
            assert action is not None  # `train` has chosen it
            return float(values[action])
        best = float(values[self.table.best(cell)])
        if self.training.method == "q_learning":
            return best
        tried = self.table.visits[cell] > 0  # the 0 of an untried action has no meaning, as in `best`
        mean = float(values[tried].mean()) if tried.any() else 0.0
        return (1.0 - self.epsilon) * best + self.epsilon * mean


def train(
    env: Any, table: QTable, training: Training, on_episode: Callable[[int, float, dict[str, Any]], None] | None = None
) -> list[float]:
    """Learn a table in an environment; return the sum of rewards of each episode, which is the learning curve.

    Args:
        env: with discrete actions, one for each of the table.
        table: is changed.
        on_episode: is called after each episode with its number, its sum of rewards and its last `info`.

    Raises:
        ParameterError: the environment has other actions than the table.
    """
    actions = getattr(env.action_space, "n", None)
    if actions != len(table.actions):
        raise ParameterError(
            f"The table has {len(table.actions)} actions, the environment has {env.action_space}.",
            fix="name one action for each of them.",
        )
    learner, curve, cell_of = TabularLearner(table, training), [], table.discretiser.cell
    for episode in range(training.episodes):
        learner.step, learner.epsilon = training.step.at(episode), training.epsilon.at(episode)
        observation, info = env.reset(seed=training.seed if episode == 0 else None)
        cell, total, is_over = cell_of(observation), 0.0, False
        action = learner.choose(cell)
        while not is_over:
            observation, reward, is_terminated, is_truncated, info = env.step(action)
            next_cell = cell_of(observation)
            next_action = learner.choose(next_cell) if training.method == "sarsa" else None
            learner.update(cell, action, float(reward), next_cell, next_action, is_terminated)
            action = learner.choose(next_cell) if next_action is None else next_action
            cell, total = next_cell, total + float(reward)
            is_over = is_terminated or is_truncated
        curve.append(total)
        if on_episode is not None:
            on_episode(episode, total, info)
    table.made_by = repr(training)
    return curve


def evaluate(env: Any, act: Callable[[Sequence[float]], Any], starts: Sequence[int]) -> list[dict[str, Any]]:
    """Return the last `info` of each episode with a policy, and its sum of rewards as `return`.

    Nothing is learned, and no action is random.

    Args:
        env: over a scenario.
        act: from observation to action.
        starts: of the scenario, which the training should not have seen.
    """
    ends = []
    for start in starts:
        observation, info = env.reset(options={"start": start})
        is_over, total = False, 0.0
        while not is_over:
            observation, reward, is_terminated, is_truncated, info = env.step(act(observation))
            total += float(reward)
            is_over = is_terminated or is_truncated
        ends.append({**info, "return": total})
    return ends
