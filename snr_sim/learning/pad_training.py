"""Q-learning of the landing in the plane, by tiles: two questions, learned from the same flights.

How hard to burn is decided by height and vertical speed, how to lean by sideways speed, tilt and turning: each has a
`TiledValues` of its own, with a reward of its own. That the engine pushes less upwards when the module leans, and
sideways the more the harder it burns, is for each of them part of the weather. A plain table over all five numbers
would need a hundred times as many cells, and never see most of them.

    burn   100 for a touchdown that is slow enough, -100 for any other, less 50 for a full tank; and the growth of a
           potential, 0.2 for each metre per second nearer to the speed that suits the height (`lander_envs.py`)
    lean   a cost of every moment, for sideways speed, tilt and turning; 20 for a touchdown that is straight, else -20

A thousand landers fly at once (`plane_batch.py`), from starts anywhere on the way down. What is learned keeps moving to
and fro a little, as long as there is anything to learn from; its mean over the second half of the training does not,
and that is the policy. Now and then it tries a few hundred landings without chance; of each question the best answers
so far are kept. Whether it lands is found out by flying the environment itself, in the real plant.

MuJoCo's own batch (`mujoco.rollout`) is not used: in flight its contacts have nothing to do, and 0.1 s of one lander
takes it 160 us, NumPy's batch of a thousand 0.4 us. Nor does it fit the flights of an evaluation: between two of its
steps the plant burns, weighs, turns the thrust and judges, so a batch would need a second copy of those rules. It would
take 0.36 of the plant's time, 0.6 of the environment's (`snr bench learning`); two processes take half, as they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from snr_sim.learning.array_file import FileMetadata, check_memory, read_arrays, write_arrays
from snr_sim.learning.lander_envs import (
    FUEL_WEIGHT,
    LANDED,
    NOT_LANDED,
    PAD_THROTTLES,
    PAD_TURNS,
    LanderPad,
    reference_speeds_mps,
    vertical_potentials,
)
from snr_sim.learning.plane_batch import Bools, Floats, PlaneLanders, step, touches
from snr_sim.learning.settings import check_batch
from snr_sim.learning.tile_coding import Axis, Ints, TileCoder, TiledValues, explore
from snr_sim.plants.lander.module import LunarModule
from snr_sim.prelude.errors import RecordingError

ENVIRONMENT = "snr_sim/LanderPad-v0"
STEP_S = 0.1
TILINGS = 8
BURN_AXES = (Axis("altitude_m", 0.0, 200.0, 30), Axis("vz_mps", -25.0, 6.0, 50))
LEAN_AXES = (Axis("vx_mps", -12.0, 12.0, 16), Axis("attitude_rad", -0.4, 0.4, 14), Axis("rate_radps", -0.2, 0.2, 12))
ALTITUDE, VX, VZ, ATTITUDE, RATE, LEFT, RIGHT = range(1, 8)  # indices in LanderPad's observation
ALL_OFF = PAD_THROTTLES.index(0.0) * len(PAD_TURNS) + PAD_TURNS.index(0.0)

DISCOUNT_BURN, DISCOUNT_LEAN = 0.99, 0.985  # discount of a step: 10 s and 7 s
LEAN_COST = (0.1, 0.3, 0.2)  # of a step, for each m/s, rad and rad/s
STRAIGHT = 20.0
MARGIN = 0.8  # of the gear's limits: the learned policy keeps this distance from them
CEILING_M, FAST_MPS, LEANING_RAD, MAX_STEPS = 250.0, 14.0, 0.6, 400  # beyond these a lander restarts
MEAN_INTERVAL = 10  # steps
MAKER = "PadPolicy.save"


class PolicyMetadata(FileMetadata, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Metadata in a policy's file: the axes of the tiles, and how many tilings each of both has."""

    burn: tuple[Axis, ...]
    lean: tuple[Axis, ...]
    tilings: int


class PadPolicy:
    """How hard to burn and how to lean, by tiles: the axes of both, and how many tilings each has."""

    def __init__(
        self, burn: Sequence[Axis] = BURN_AXES, lean: Sequence[Axis] = LEAN_AXES, tilings: int = TILINGS
    ) -> None:
        self.burn: TiledValues = TiledValues(TileCoder(burn, tilings), len(PAD_THROTTLES))
        self.lean: TiledValues = TiledValues(TileCoder(lean, tilings), len(PAD_TURNS))
        self.made_by: str = ""

    def act(self, observation: Sequence[float]) -> int:
        """Return the action of `LanderPad` with the highest value for an observation. Changes nothing.

        Once a foot touches, all is off: what was learned ends there, and so did the crews at the contact light.
        """
        if observation[LEFT] or observation[RIGHT]:
            return ALL_OFF
        seen = np.array(observation, np.float64)
        throttle = int(self.burn.best(seen[None, [ALTITUDE, VZ]])[0])
        turn = int(self.lean.best(seen[None, [VX, ATTITUDE, RATE]])[0])
        return throttle * len(PAD_TURNS) + turn

    def save(self, path: str | Path) -> None:
        """Write the policy as npz: arrays of numbers, and a line of JSON about them.

        Raises:
            RecordingError: it cannot be written there.
        """
        burn, lean = self.burn.coder, self.lean.coder
        about = PolicyMetadata(
            environment=ENVIRONMENT, made_by=self.made_by, burn=burn.axes, lean=lean.axes, tilings=burn.tilings
        )
        write_arrays(path, about, {"burn": self.burn.weights, "lean": self.lean.weights})

    @classmethod
    def load(cls, path: str | Path) -> PadPolicy:
        """Return the policy in a file.

        Raises:
            RecordingError: the file is missing, of another kind, truncated or damaged, or for something else.
        """

        def empty(about: PolicyMetadata) -> tuple[PadPolicy, dict[str, NDArray[Any]]]:
            for question, found, expected in (("burn", about.burn, BURN_AXES), ("lean", about.lean, LEAN_AXES)):
                ours, theirs = ([axis.name for axis in axes] for axes in (expected, found))
                if theirs != ours:
                    raise RecordingError(
                        f"{path} decides how to {question} by {', '.join(theirs) or 'nothing'}; what flies looks at "
                        f"{', '.join(ours)}.",
                        fix="a policy with those axes, in that order.",
                    )
                check_memory(2 * about.tilings * math.prod(axis.intervals + 1 for axis in found) * len(PAD_THROTTLES))
            policy = cls(about.burn, about.lean, about.tilings)
            policy.made_by = about.made_by
            return policy, {"burn": policy.burn.weights, "lean": policy.lean.weights}

        return read_arrays(path, PolicyMetadata, empty, "policy of tiles", MAKER, ENVIRONMENT)


@dataclass(frozen=True)
class PadTraining:
    """Settings of the training, as those of `BatchTraining` but for these.

    Args:
        min_step_size: step size of an update: at first, and at the end.
        eval_interval: steps between two trials, in the second half of the training.

    Raises:
        ParameterError: a number is out of range.
    """

    landers: int = 1024
    steps: int = 9_000
    seed: int = 0
    epsilon: tuple[float, float] = (0.4, 0.05)
    min_step_size: tuple[float, float] = (0.05, 0.004)
    eval_episodes: int = 400
    eval_interval: int = 250

    def __post_init__(self) -> None:
        check_batch(self, ("landers", "steps", "eval_episodes", "eval_interval"))


class EvaluationResult(NamedTuple):
    """Result of a trial: fractions of all landers that touched down slowly enough, straight enough, and both."""

    slow: float
    straight: float
    landed: float


class PadBatchTask:
    """Simulation of a batch of landers of an environment: the module, its starts and its sensors."""

    def __init__(self, env: LanderPad, seed: int | Sequence[int]) -> None:
        parameters: Any = env.run.with_seed(0).robot.parameters  # not those of the current plant, which may have moved
        self.module: LunarModule = parameters.module
        self.dry_kg: float = parameters.mass_kg - parameters.fuel_kg
        radar, inertial = parameters.radar.errors.noise, parameters.inertial.errors.noise
        height, speed = radar["altitude_m"], inertial["velocity_mps"]
        self._noise = np.array([height, speed, speed, inertial["attitude_rad"], inertial["rate_radps"]])
        self.rng: np.random.Generator = np.random.default_rng(seed)

    def exploring_starts(self, count: int) -> PlaneLanders:
        """Return random starts within a descent, most of them low, and most of them nearly straight."""
        draw = self.rng.uniform
        height = 180.0 * self.rng.random(count) ** 2
        near = np.minimum(1.0, 0.2 + height / 50.0)
        fuel, throttle = draw(200.0, 700.0, count), self.rng.choice(np.array(PAD_THROTTLES), count)
        vz = reference_speeds_mps(height, self.module.gravity_mps2) + draw(-8.0, 8.0, count) * near
        attitude, rate = (limit * draw(-1.0, 1.0, count) ** 3 for limit in (0.35, 0.15))
        vx = draw(-9.0, 9.0, count) * self.rng.random(count)
        return PlaneLanders(height, vz, vx, attitude, rate, self.dry_kg + fuel, fuel, throttle)

    def scenario_starts(self, count: int) -> PlaneLanders:
        """Return starts as the scenario draws them."""
        draw = self.rng.uniform
        height, vz, vx = draw(116.0, 178.0, count), draw(-8.0, -2.0, count), draw(-6.0, 6.0, count)
        attitude, rate = np.radians(draw(-6.0, 6.0, count)), np.radians(draw(-1.0, 1.0, count))
        fuel = draw(500.0, 700.0, count)
        return PlaneLanders(height, vz, vx, attitude, rate, self.dry_kg + fuel, fuel, np.zeros(count))

    def observe(self, landers: PlaneLanders) -> tuple[Floats, Floats]:
        """Return what the sensors measure: height and vz, shape (n, 2); vx, attitude and rate, shape (n, 3)."""
        truth = np.stack(landers[:5], axis=1)
        truth += self.rng.normal(size=truth.shape) * self._noise
        return truth[:, :2], truth[:, 2:]

    def is_within(self, landers: PlaneLanders, share: float = 1.0) -> tuple[Bools, Bools]:
        """Return whether the gear would take the vertical speed of each, and whether the rest of its motion.

        Args:
            landers: at their first contact, with level ground: so there they also stand upright.
            share: of each limit.
        """
        motion = -landers.vz_mps, landers.vx_mps, landers.attitude_rad, landers.rate_radps
        slow, lateral, attitude, rate, _ = self.module.gear.is_within(*motion, share=share)
        return slow, lateral & attitude & rate

    def burn_rewards(self, before: PlaneLanders, after: PlaneLanders, down: Bools) -> Floats:
        """Return the reward of a step for the policy of the throttle."""
        tank_kg = 600.0  # about what they start with
        gravity = self.module.gravity_mps2
        was, then = (vertical_potentials(one.height_m, one.vz_mps, gravity) for one in (before, after))
        ends = np.where(self.is_within(after, MARGIN)[0], LANDED, NOT_LANDED)
        burned: Floats = (before.fuel_kg - after.fuel_kg) / tank_kg
        reward: Floats = np.where(down, ends, DISCOUNT_BURN * then) - was - FUEL_WEIGHT * burned
        return reward

    def lean_rewards(self, after: PlaneLanders, down: Bools) -> Floats:
        """Return the reward of a step for the policy of the attitude."""
        motion = (after.vx_mps, after.attitude_rad, after.rate_radps)
        cost = sum(weight * np.abs(one) for weight, one in zip(LEAN_COST, motion, strict=True))
        ends = np.where(self.is_within(after, MARGIN)[1], STRAIGHT, -STRAIGHT)
        reward: Floats = np.where(down, ends, 0.0) - cost
        return reward


def train_pad(
    policy: PadPolicy, env: LanderPad, training: PadTraining | None = None, on_step: Callable[[], None] = lambda: None
) -> list[EvaluationResult]:
    """Learn to land in the plane; return the trials on the way, which are the learning curve.

    Args:
        policy: is changed; afterwards it has the best answers that were tried.
        env: what it is for: its module, sensors and masses.
        on_step: is called after each step.
    """
    how = training or PadTraining()
    task = PadBatchTask(env, how.seed)
    rng, burn, lean = task.rng, policy.burn, policy.lean
    throttles, turns = np.array(PAD_THROTTLES), np.array(PAD_TURNS)
    landers, episode_steps = task.exploring_starts(how.landers), np.zeros(how.landers, np.int64)
    burn_tiles, lean_tiles = _tiles(policy, task, landers)
    results: list[EvaluationResult] = []
    mean = PadPolicy(burn.coder.axes, lean.coder.axes, burn.coder.tilings)
    pairs, means = ((mean.burn, burn), (mean.lean, lean)), 0
    kept = [(-1.0, burn.weights), (-1.0, lean.weights)]
    for i in range(how.steps):
        epsilon = max(how.epsilon[1], how.epsilon[0] * (1.0 - i / (0.7 * how.steps)))
        min_step_size = max(how.min_step_size[1], how.min_step_size[0] * (1.0 - i / (0.8 * how.steps)))
        throttle, turn = explore(burn.of(burn_tiles), epsilon, rng), explore(lean.of(lean_tiles), epsilon, rng)
        after = step(landers, throttles[throttle], turns[turn], task.module, STEP_S)
        down = touches(after)
        next_burn, next_lean = _tiles(policy, task, landers)  # sensor readings are a step late
        burn_value = np.where(down, 0.0, DISCOUNT_BURN * burn.of(next_burn).max(axis=1))
        lean_value = np.where(down, 0.0, DISCOUNT_LEAN * lean.of(next_lean).max(axis=1))
        burn.learn(burn_tiles, throttle, task.burn_rewards(landers, after, down) + burn_value, min_step_size)
        lean.learn(lean_tiles, turn, task.lean_rewards(after, down) + lean_value, min_step_size)
        episode_steps += 1
        landers, burn_tiles, lean_tiles = after, next_burn, next_lean
        over = down | _is_lost(after) | (episode_steps > MAX_STEPS)
        if over.any():
            fresh = task.exploring_starts(int(over.sum()))
            for array, begins in zip(landers, fresh, strict=True):
                array[over] = begins
            episode_steps[over] = 0
            burn_tiles[over], lean_tiles[over] = _tiles(policy, task, fresh)
        on_step()
        if i >= how.steps // 2 and i % MEAN_INTERVAL == 0:
            means += 1
            for one, learned in pairs:
                one.weights += (learned.weights - one.weights) / means
        if means and ((i + 1) % how.eval_interval == 0 or i + 1 == how.steps):
            result = evaluate_policy(mean, env, how.eval_episodes, seed=how.seed)
            results.append(result)
            for k, share in enumerate((result.slow, result.straight)):
                if share >= kept[k][0]:
                    kept[k] = share, pairs[k][0].weights.copy()
    burn.weights, lean.weights = kept[0][1], kept[1][1]
    policy.made_by = repr(how)
    return results


def evaluate_policy(policy: PadPolicy, env: LanderPad, count: int, seed: int) -> EvaluationResult:
    """Return the result of landing by a policy in the batch, without exploration and without learning."""
    task = PadBatchTask(env, [seed, 1])
    throttles, turns = np.array(PAD_THROTTLES), np.array(PAD_TURNS)
    landers = task.scenario_starts(count)
    observed = task.observe(landers)
    found = np.zeros(3)
    for _ in range(int(env.limit_s / STEP_S)):
        actions = throttles[policy.burn.best(observed[0])], turns[policy.lean.best(observed[1])]
        observed = task.observe(landers)
        landers = step(landers, *actions, task.module, STEP_S)
        down = touches(landers)
        slow, straight = (down & one for one in task.is_within(landers))
        found += slow.sum(), straight.sum(), (slow & straight).sum()
        is_flying = ~(down | _is_lost(landers))
        if not is_flying.any():
            break
        landers, observed = (
            PlaneLanders(*(one[is_flying] for one in landers)),
            (observed[0][is_flying], observed[1][is_flying]),
        )
    return EvaluationResult(*(found / count).tolist())


def _tiles(policy: PadPolicy, task: PadBatchTask, landers: PlaneLanders) -> tuple[Ints, Ints]:
    """Return the tiles of both questions where sensors see landers."""
    burn, lean = task.observe(landers)
    return policy.burn.coder.tiles(burn), policy.lean.coder.tiles(lean)


def _is_lost(landers: PlaneLanders) -> Bools:
    lost: Bools = (
        (landers.height_m > CEILING_M)
        | (np.abs(landers.vx_mps) > FAST_MPS)
        | (np.abs(landers.attitude_rad) > LEANING_RAD)
    )
    return lost
