"""Q-learning of the vertical landing in seconds: a thousand landers run in parallel and update one table.

The update is that of `tabular.py`, computed for all landers in a few array operations. Each lander starts at a random
height and speed of a descent (exploring starts), so the whole table is visited early. The learned table keeps
fluctuating: one version lands 80 of 100 where the next lands all of them. Its running mean does not fluctuate, so the
mean is used as the policy. From time to time the mean lands a few hundred landers without exploration, from their own
starts; the best mean so far is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from snr_sim.learning.discretiser import Discretiser
from snr_sim.learning.lander_envs import (
    FUEL_WEIGHT,
    LANDED,
    NOT_LANDED,
    VERTICAL_ACTIONS,
    VERTICAL_NAMES,
    VERTICAL_THROTTLES,
    LanderVertical,
    reference_speeds_mps,
    vertical_potentials,
)
from snr_sim.learning.q_table import QTable
from snr_sim.learning.settings import check_batch, check_finite
from snr_sim.learning.tile_coding import Ints, explore
from snr_sim.learning.vertical_batch import Bools, Floats, Landers, step
from snr_sim.plants.lander.descent import Engine
from snr_sim.plants.lander.gear import APOLLO_GEAR

ENVIRONMENT = "snr_sim/LanderVertical-v0"
STEP_S = 0.2
CEILING_M, MAX_STEPS = 2000.0, 600  # a lander that climbs, or hovers for two minutes, restarts
MEAN_INTERVAL = 10  # steps
MEAN_SHARE = 0.1  # of all steps: how far back the running mean reaches
FINAL_EVAL_FACTOR, MIN_FINAL_SUCCESS = 5, 0.9995  # a table that lands 995 of 1000 lands 2 times 400 every 50th time


@dataclass(frozen=True)
class BatchTraining:
    """Settings of the training.

    Args:
        landers: number of landers that are simulated in parallel.
        steps: total number of steps, for all landers together.
        seed: of all random numbers.
        epsilon: probability of a random action: at first, and the minimum.
        min_step_size: minimum step size of an update. The first visit of a cell takes the whole difference; the step
            size falls with each visit.
        eval_episodes: number of landers in a trial, which is without exploration.
        eval_interval: steps between two trials; there is also one before the first step and one after the last.
        solved_streak: the training ends early after this number of consecutive trials in which all landers land,
            provided that at least the fraction `MIN_FINAL_SUCCESS` of `FINAL_EVAL_FACTOR` times as many new landers
            then lands.

    Raises:
        ParameterError: a number is out of range.
    """

    landers: int = 1024
    steps: int = 3000
    seed: int = 0
    epsilon: tuple[float, float] = (0.5, 0.05)
    min_step_size: float = 0.02
    eval_episodes: int = 400
    eval_interval: int = 200
    solved_streak: int = 2

    def __post_init__(self) -> None:
        check_batch(self, ("landers", "steps", "eval_episodes", "eval_interval", "solved_streak"))


class EvaluationResult(NamedTuple):
    """Result of a trial: fraction of landers that landed, and the propellant that they burned on average."""

    landed: float
    fuel_kg: float


def fine_grid() -> Discretiser:
    """Return 80 heights, closer together near the ground, times 92 speeds, closer together where it is slow."""
    heights = [0.25, *(0.25 * k * k for k in range(2, 80))]
    speeds = [*np.arange(-110.0, -30.0, 2.0), *np.arange(-30.0, -10.0), *np.arange(-10.0, 4.1, 0.5), 8.0, 16.0]
    return Discretiser(VERTICAL_NAMES, (tuple(heights), tuple(float(one) for one in speeds)))


def coarse_grid() -> Discretiser:
    """Return 36 heights times 23 speeds: few enough to be learned one landing after the other."""
    heights = [1500.0 * (k / 36) ** 2 for k in range(1, 36)]
    speeds = [-80, -60, -50, -42, -36, -30, -26, -22, -18, -15, -12, -10, -8, -6, -5, -4, -3, -2, -1, 0, 2, 6]
    return Discretiser(VERTICAL_NAMES, (tuple(heights), tuple(float(one) for one in speeds)))


def new_table(grid: Discretiser | None = None) -> QTable:
    """Return an empty table for LanderVertical."""
    return QTable(fine_grid() if grid is None else grid, VERTICAL_ACTIONS, ENVIRONMENT)


class VerticalBatchTask:
    """Quantities that all landers share.

    Args:
        engine: of each lander.
        tank_kg: propellant that burned propellant is divided by in the reward.
        dry_kg: mass without propellant.
        noise: standard deviation of the radar's height [m] and speed [m/s]; readings arrive one step late.
    """

    def __init__(self, engine: Engine, tank_kg: float, dry_kg: float, noise: tuple[float, float]) -> None:
        self.engine: Engine = engine
        self.tank_kg: float = tank_kg
        self.dry_kg: float = dry_kg
        self.noise: Floats = np.array(noise)

    def exploring_starts(self, count: int, rng: np.random.Generator) -> Floats:
        """Return random starts within a descent, shape (4, count), rows as in `Landers`."""
        height = 1500.0 * rng.random(count) ** 2
        speed = self.reference_speed(height) + rng.uniform(-25.0, 25.0, count) * np.minimum(1.0, 0.2 + height / 200.0)
        mass = rng.uniform(7000.0, 8500.0, count)
        return np.stack([height, speed, mass, mass - self.dry_kg])

    def scenario_starts(self, count: int, rng: np.random.Generator) -> Floats:
        """Return starts as the scenario draws them."""
        mass = rng.uniform(7500.0, 8500.0, count)
        height, speed = rng.uniform(600.0, 1500.0, count), rng.uniform(-25.0, 5.0, count)
        return np.stack([height, speed, mass, mass - self.dry_kg])

    def observe(self, heights: Floats, speeds: Floats, rng: np.random.Generator) -> Floats:
        """Return noisy radar readings of heights and speeds, shape (count, 2)."""
        truth: Floats = np.stack([heights, speeds], axis=1)
        truth += rng.normal(size=truth.shape) * self.noise
        return truth

    def reference_speed(self, height: Floats) -> Floats:
        """Return the suitable speed for each height, as defined by the reward."""
        return reference_speeds_mps(height, self.engine.gravity_mps2)

    def rewards(self, before: Landers, after: Landers, touches: Bools, landed: Bools) -> Floats:
        """Return what a step was worth to each, as in `LanderEnv.reward`."""
        gravity = self.engine.gravity_mps2
        potential, then = (vertical_potentials(one.height_m, one.velocity_mps, gravity) for one in (before, after))
        ends = np.where(landed, LANDED, NOT_LANDED)
        burned: Floats = (before.fuel_kg - after.fuel_kg) / self.tank_kg
        reward: Floats = np.where(touches, ends, then) - potential - FUEL_WEIGHT * burned
        return reward


def vertical_batch_task(env: LanderVertical, start: int = 0) -> VerticalBatchTask:
    """Return what an environment's landers share: engine, masses and radar noise; `start` is the seed of the tank.

    The values are read from the scenario and not from the current plant, which may have burned propellant already.
    """
    parameters: Any = env.run.with_seed(start).robot.parameters
    noise = parameters.radar.errors.noise
    dry_kg = parameters.mass_kg - parameters.fuel_kg
    return VerticalBatchTask(
        parameters.engine, parameters.fuel_kg, dry_kg, (noise["altitude_m"], noise["velocity_mps"])
    )


def train_vertical(
    table: QTable,
    task: VerticalBatchTask,
    training: BatchTraining | None = None,
    on_evaluation: Callable[[int, EvaluationResult], None] | None = None,
) -> list[EvaluationResult]:
    """Learn a table of the vertical landing; return the trials, which are the learning curve.

    Each trial has its own starts. With the same starts every time, a table that suits only those would score best.

    Args:
        table: is changed; afterwards it is the best table of all trials, the latest of several.
        on_evaluation: is called with the step and the result of the trial.

    Raises:
        ParameterError: a value would become infinite or NaN. Then the table is as it was before that step.
    """
    how = training or BatchTraining()
    rng = np.random.default_rng(how.seed)
    throttles, cells_of = np.array(VERTICAL_THROTTLES), table.discretiser.cells
    values, visits = table.values.reshape(-1), table.visits.reshape(-1)
    count = len(VERTICAL_THROTTLES)
    landers = task.exploring_starts(how.landers, rng)
    episode_steps = np.zeros(how.landers, np.int64)
    cells = cells_of(task.observe(landers[0], landers[1], rng))
    mean = QTable(table.discretiser, table.actions, table.environment)
    mean.values[:], mean.visits = table.values, table.visits
    follows = min(1.0, MEAN_INTERVAL / (MEAN_SHARE * how.steps))
    results, best, kept = list[EvaluationResult](), -1.0, (table.values, table.visits)

    def evaluate(steps: int) -> bool:
        """Try the mean, and keep it if it is the best; return whether that is enough."""
        nonlocal best, kept
        results.append(result := evaluate_table(mean, task, how.eval_episodes, [how.seed, steps]))
        if result.landed >= best:
            best, kept = result.landed, (mean.values.copy(), mean.visits.copy())
        if on_evaluation is not None:
            on_evaluation(steps, result)
        if len(results) < how.solved_streak or any(one.landed < 1.0 for one in results[-how.solved_streak :]):
            return False
        return (
            evaluate_table(mean, task, FINAL_EVAL_FACTOR * how.eval_episodes, [how.seed, steps, 1]).landed
            >= MIN_FINAL_SUCCESS
        )

    evaluate(0)
    for i in range(how.steps):
        epsilon = max(how.epsilon[1], how.epsilon[0] * (1.0 - i / (0.7 * how.steps)))
        actions = explore(table.values[cells], epsilon, rng)
        before = Landers(*landers)
        after, touches, speeds = step(before, throttles[actions], task.engine, STEP_S)
        rewards = task.rewards(before, after, touches, touches & APOLLO_GEAR.is_within(speeds)[0])
        next_cells = cells_of(task.observe(before.height_m, before.velocity_mps, rng))  # radar readings are a step late
        targets = rewards + np.where(touches, 0.0, table.values[next_cells].max(axis=1))
        check_finite(float(targets.sum()), f"step {i + 1}")
        _update_values(values, visits, cells * count + actions, targets, how.min_step_size)
        episode_steps += 1
        over = touches | (after.height_m > CEILING_M) | (episode_steps > MAX_STEPS)
        landers, cells = np.stack(after), next_cells
        if over.any():
            fresh = task.exploring_starts(int(over.sum()), rng)
            landers[:, over], episode_steps[over] = fresh, 0
            cells[over] = cells_of(task.observe(fresh[0], fresh[1], rng))
        is_last = i + 1 == how.steps
        if (i + 1) % MEAN_INTERVAL == 0 or is_last:
            mean.values += follows * (table.values - mean.values)
        if ((i + 1) % how.eval_interval == 0 or is_last) and evaluate(i + 1):
            break
    table.values[:], table.visits[:] = kept
    table.made_by = repr(how)
    return results


def evaluate_table(table: QTable, task: VerticalBatchTask, count: int, seed: int | Sequence[int]) -> EvaluationResult:
    """Return the result of landing by a table from random starts, without exploration and without learning."""
    rng = np.random.default_rng([*np.atleast_1d(seed).tolist(), 1])
    landers = task.scenario_starts(count, rng)
    greedy = np.argmax(np.where(table.visits > 0, table.values, -np.inf), axis=1)  # 0 where nothing was tried
    throttles, cells_of = np.array(VERTICAL_THROTTLES), table.discretiser.cells
    observed = task.observe(landers[0], landers[1], rng)
    landed, burned_kg, is_flying = 0, 0.0, np.ones(count, bool)
    for _ in range(MAX_STEPS):
        before = Landers(*landers)
        after, touches, speeds = step(before, throttles[greedy[cells_of(observed)]], task.engine, STEP_S)
        observed = task.observe(before.height_m, before.velocity_mps, rng)
        landed += int((touches & APOLLO_GEAR.is_within(speeds)[0]).sum())
        burned_kg += float((before.fuel_kg - after.fuel_kg).sum())
        is_flying = ~touches
        if not is_flying.any():
            break
        landers, observed = np.stack(after)[:, is_flying], observed[is_flying]
    return EvaluationResult(landed / count, burned_kg / count)


def _update_values(values: Floats, visits: Ints, places: Ints, targets: Floats, min_step_size: float) -> None:
    """Move the values at some indices towards targets; of several for one index, towards their mean.

    `TiledValues.learn` would take twice as long, as it looks at all values.
    """
    hit, which, counts = np.unique(places, return_inverse=True, return_counts=True)
    visits[hit] += counts
    steps = np.maximum(min_step_size, (1.0 + visits[hit] / 30.0) ** -0.7)
    values[hit] += steps * (np.bincount(which, targets) / counts - values[hit])
