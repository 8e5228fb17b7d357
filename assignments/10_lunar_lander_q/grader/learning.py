"""Grader's side of lab 10: simulates many landers at once, and asks the student's file for their states by message.

    parent (here)                                            child (`pilot.py`)
    Landers, random numbers,  -- observations of all, results of the last step -->  encode, reward, update
    budget, score, table      <-- their states, and what the last step was worth --

One message per step for all of them, so the pipe costs little compared with the student's own functions. Only this
side knows the number of steps and episodes, the starts, the actions and which landers landed. What was learned flies in
the form in which it is submitted, as a table on snr_sim's grid: one message, and none during a flight. In practice,
without the grader, the student's own choose() and table decide instead.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from snr_sim.grading import SubmissionError
from snr_sim.learning import VERTICAL_THROTTLES, QTable, VerticalBatchTask, new_table, vertical_batch_task
from snr_sim.learning.batch_training import CEILING_M, MAX_STEPS, STEP_S
from snr_sim.learning.lander_envs import LanderVertical
from snr_sim.learning.vertical_batch import Floats, Landers, step
from snr_sim.plants import APOLLO_GEAR
from snr_sim.prelude.task import ensure_type_info

from .evidence import Evidence, pack_rows, parse_rewards, parse_states
from .pilot import CRASHED, LANDED, MAX_STATES, TIMEOUT, StudentPolicy
from .q_rule import Step

# So many fly at once in training. With fewer the pipe costs more: each message finds the caches cold. With a thousand
# more tables do not land 80 of 100: of 25 trainings of the reference one, and of 25 with finer states three.
LANDERS = 256
MAX_TRAINING_STEPS, MAX_EPISODES = 80_000, 3000  # of all of them together
FLIGHT_STEPS = 600  # two minutes; free fall from the highest start takes 50 s
THROTTLES = np.array(VERTICAL_THROTTLES)


class TrainingStep(msgspec.Struct):
    """Answer to a step of training, see `StudentPolicy.learn`."""

    states: str
    last: list[int]
    rewards: str
    epsilon: float


class LocalSubmission:
    """A student's file in this process, for practice: its own functions decide everything."""

    def __init__(self, module: ModuleType) -> None:
        self.pilot = StudentPolicy(module)

    def ask(self, method: str, *args: Any, returns: Any = Any) -> Any:
        """Return what a method of `StudentPolicy` returns, as `Student.create_object` does."""
        return msgspec.convert(getattr(self.pilot, method)(*args), ensure_type_info(returns))

    def act(self, observed: Floats) -> NDArray[np.intp]:
        """Return the actions of the student's choose() without exploration."""
        return np.array(self.pilot.choose(self.states_at(observed), 0.0), np.intp)

    def states_at(self, observed: Floats) -> list[int]:
        """Return the result of encode() for each observation."""
        return self.pilot.encode(*observed.T.tolist())

    def rows(self) -> tuple[Floats, NDArray[np.int64]]:
        """Return the student's own table."""
        return np.array(self.pilot.table.values), np.array(self.pilot.table.visits)


@dataclass(frozen=True)
class TrainingResult:
    """What a training took, of all landers together; and of each episode, as they ended, whether it landed."""

    steps: int
    episodes: int
    landed: list[bool]


@dataclass(frozen=True)
class LandingStats:
    """Results of flying.

    Args:
        landed: of each start, whether it landed.
        outcomes: number of landings by outcome.
        fuel_kg: mean propellant of those that landed; 0 if none did.
        touchdown_mps: mean speed at the ground, of the landers that reached it; 0 if none did.
    """

    landed: list[bool]
    outcomes: dict[str, int]
    fuel_kg: float
    touchdown_mps: float

    @property
    def share(self) -> float:
        """Which fraction of all landed."""
        return sum(self.landed) / len(self.landed)


@cache
def landing_task() -> VerticalBatchTask:
    """Return the vertical landing of the scenario `lander_vertical`."""
    env = LanderVertical()
    env.reset(options={"start": 0})
    return vertical_batch_task(env)


def train(
    student: Any,
    seed: int,
    evidence: Evidence | None = None,
    max_steps: int = MAX_TRAINING_STEPS,
    max_episodes: int = MAX_EPISODES,
) -> TrainingResult:
    """Train a student's file, in landings that begin anywhere on the way down.

    Args:
        student: learns, and keeps what it has learned; by `Student.create_object` or `LocalSubmission`.
        seed: of the starts, of the radar's noise and of the student's random numbers.
        evidence: learns the same, and chooses the actions; without it the student's own choose() does.
        max_steps, max_episodes: limits of the training; it ends at the first one reached.

    Raises:
        SubmissionError: it does not report valid states or rewards.
    """
    task, rng = landing_task(), np.random.default_rng([seed, 2])
    student.ask("begin", int(rng.integers(2**31)))  # not the seed itself, which would reveal the starts
    landers = _starts(task, LANDERS, rng)
    observed = _observe(task, landers, rng)
    episode_steps, episodes, ended = np.zeros(LANDERS, np.int64), LANDERS, list[bool]()
    burned_kg: list[Floats] = []  # of the last step, once there was one
    ends: list[list[Any]] = []  # lists, since tuples would need a conversion for the message
    states, actions = list[int](), np.empty(0, np.intp)  # of the last step, too
    count = MAX_STATES if evidence is None else evidence.states
    steps = -(-max_steps // LANDERS)
    for i in range(steps):
        share = max(i / steps, min(1.0, (episodes - LANDERS) / max_episodes))
        done = "".join(map(str, actions.tolist()))
        answer: TrainingStep = student.ask(
            "learn", share, pack_rows(observed.T, landers[:2], *burned_kg), ends, done, returns=TrainingStep
        )
        came_from, states = states, parse_states(answer.states, LANDERS, count)
        epsilon = min(1.0, max(0.0, answer.epsilon))
        if evidence is None:
            actions = np.array(student.ask("choose", states, epsilon), np.intp)
        else:
            evidence.learn(_transitions(came_from, actions.tolist(), states, ends, answer, count))
            actions = evidence.choose(observed, states, epsilon)
        before = Landers(*landers)
        after, touches, speeds = step(before, THROTTLES[actions], task.engine, STEP_S)
        observed = _observe(task, landers, rng)  # radar readings, one step late
        landers, burned_kg, ends = np.stack(after), [before.fuel_kg - after.fuel_kg], []
        episode_steps += 1
        over = np.flatnonzero(touches | (after.height_m > CEILING_M) | (episode_steps > MAX_STEPS))
        for lander in over.tolist():
            is_down, speed = bool(touches[lander]), round(float(speeds[lander]), 2)
            is_landed = is_down and bool(APOLLO_GEAR.is_within(speeds[lander])[0])
            ended.append(is_landed)
            last = [0.0, -speed] if is_down else landers[:2, lander].tolist()
            ends.append([lander, *last, (LANDED if is_landed else CRASHED) if is_down else TIMEOUT])
        if len(over):
            landers[:, over], episode_steps[over] = _starts(task, len(over), rng), 0
            observed[over] = _observe(task, landers[:, over], rng)
            episodes += len(over)
            if episodes > max_episodes:
                break
    return TrainingResult((i + 1) * LANDERS, episodes, ended)


def simulate_landings(policy: Any, seed: int, count: int, gravity: float = 1.0, thrust: float = 1.0) -> LandingStats:
    """Land with a policy, without learning and without exploration.

    Args:
        policy: `act` returns an action for each observation, shape (n, 2): height [m] and velocity [m/s].
        seed: of the starts and of the radar's noise. They begin as the scenario does, 600 to 1500 m up.
        count: of starts.
        gravity, thrust: of the Moon and the engine, as fractions of what was trained with.
    """
    task = landing_task()
    nominal = task.engine
    engine = nominal._replace(gravity_mps2=nominal.gravity_mps2 * gravity, thrust_n=nominal.thrust_n * thrust)
    rng = np.random.default_rng([seed, 3])
    landers = task.scenario_starts(count, rng)
    tank_kg = landers[3].copy()
    observed, who = _observe(task, landers, rng), np.arange(count)
    speed_mps, fuel_kg = np.full(count, np.nan), np.zeros(count)
    for _ in range(FLIGHT_STEPS):
        after, touches, speeds = step(Landers(*landers), THROTTLES[policy.act(observed)], engine, STEP_S)
        observed = _observe(task, landers, rng)
        speed_mps[who[touches]] = speeds[touches]
        fuel_kg[who] = tank_kg[who] - after.fuel_kg
        is_flying = ~touches
        landers, observed, who = np.stack(after)[:, is_flying], observed[is_flying], who[is_flying]
        if not len(who):
            break
    is_down = np.isfinite(speed_mps)
    landed = is_down & APOLLO_GEAR.is_within(speed_mps)[0]
    outcomes = {LANDED: landed, CRASHED: is_down & ~landed, TIMEOUT: ~is_down}
    return LandingStats(
        landed.tolist(),
        {name: int(which.sum()) for name, which in outcomes.items()},
        float(fuel_kg[landed].mean()) if landed.any() else 0.0,
        float(speed_mps[is_down].mean()) if is_down.any() else 0.0,
    )


def _transitions(
    states: list[int], actions: list[int], now: list[int], ends: list[list[Any]], answer: TrainingStep, count: int
) -> Iterator[Step]:
    """Yield what a step was for each lander, if there was one; plain tuples, for there are 80 000 in a training."""
    then, is_terminated, is_truncated = list(now), [False] * len(now), [False] * len(now)
    if len(answer.last) != len(ends) or not all(0 <= state < count for state in answer.last):
        raise SubmissionError(
            "It did not report the states in which episodes ended.", "Do not modify the code that calls encode()."
        )
    for (i, _, _, outcome), state in zip(ends, answer.last, strict=True):
        then[i], is_terminated[i], is_truncated[i] = state, outcome != TIMEOUT, outcome == TIMEOUT
    rewards = parse_rewards(answer.rewards, len(states))
    return zip(states, actions, rewards, then, is_terminated, is_truncated, strict=bool(states))


def _starts(task: VerticalBatchTask, count: int, rng: np.random.Generator) -> Floats:
    """Return starts anywhere on the way down, shape (4, count), half of them in the last 25 m.

    There it is decided, and from high above few come there in time: with half of them in the last 400 m, states near
    the ground were seen a few dozen times in a training, and of 57 trained references one landed 88 of 100.
    """
    height = 1500.0 * rng.random(count) ** 6
    speed = task.reference_speed(height) + rng.uniform(-25.0, 25.0, count) * np.minimum(1.0, 0.2 + height / 200.0)
    mass = rng.uniform(7000.0, 8500.0, count)
    return np.stack([height, speed, mass, mass - task.dry_kg])


def _observe(task: VerticalBatchTask, landers: Floats, rng: np.random.Generator) -> Floats:
    """Return the radar's readings, in its steps of a centimetre."""
    observed: Floats = np.round(task.observe(landers[0], landers[1], rng), 2)
    return observed


class TablePolicy:
    """A submitted table, used as by the node's controller 'q': none of the student's code runs."""

    def __init__(self, table: QTable) -> None:
        self._cells = table.discretiser.cells
        self._greedy = np.argmax(np.where(table.visits > 0, table.values, -np.inf), axis=1)  # 0 where nothing was tried

    def act(self, observed: Floats) -> NDArray[np.intp]:
        """Return the best of the actions tried."""
        actions: NDArray[np.intp] = self._greedy[self._cells(observed)]
        return actions


def policy_table(learner: Evidence | LocalSubmission) -> QTable:
    """Return what was learned as a table that `--controller q` flies.

    Each cell of the grid of snr_sim gets the row of the state that is found in its middle.
    """
    policy = new_table()
    heights, speeds = (np.array([2.0 * edges[0] - edges[1], *edges]) for edges in policy.discretiser.edges)
    # Cells begin at these edges; the last one is as long as the one before.
    middles = (edges + 0.5 * np.diff(edges, append=2.0 * edges[-1] - edges[-2]) for edges in (heights, speeds))
    states = learner.states_at(np.stack([axis.ravel() for axis in np.meshgrid(*middles, indexing="ij")], axis=1))
    values, visits = learner.rows()
    policy.values[:], policy.visits[:] = values[states], visits[states]
    return policy
