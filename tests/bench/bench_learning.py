"""Learning: the compatible environment against Box2D's, steps of the scenarios' environments, and a training.

Run by `snr bench learning`.
Box2D comes with the extra `bench`.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import mujoco
import numpy as np
from harness import Benchmark, Row, compare, cpu_time_of
from landing_policies import straight_down, to_the_ground
from mujoco.rollout import Rollout

import snr_sim.learning  # noqa: F401 - makes the names known
from snr_sim.learning.batch_training import BatchTraining, new_table, train_vertical, vertical_batch_task
from snr_sim.learning.gym import COMPATIBLE
from snr_sim.learning.pad_training import STEP_S, PadBatchTask, PadPolicy, PadTraining, train_pad
from snr_sim.learning.plane_batch import step
from snr_sim.learning.tabular import evaluate
from snr_sim.prelude.signals import EngineCommand

ORIGINAL = "LunarLander-v3"
UNSEEN = range(1, 101)
LANDERS = 1024  # of a vector environment


def steps_of(name: str, count: int, **kwargs: Any) -> Callable[[], Callable[[], None]]:
    """Return a trial: so many steps with actions drawn beforehand, resets between episodes included."""
    env: Any = gymnasium.make(name, **kwargs).unwrapped
    env.action_space.seed(1)
    actions = [env.action_space.sample() for _ in range(count)]
    if isinstance(env.action_space, gymnasium.spaces.Discrete):
        actions = [int(action) for action in actions]

    def benchmark() -> Callable[[], None]:
        env.reset(seed=0)

        def run() -> None:
            for action in actions:
                _, _, *ended, _ = env.step(action)
                if any(ended):
                    env.reset()

        return run

    return benchmark


def vector_steps_of(name: str, count: int, policy: Callable[[Any], Any] | None) -> tuple[Callable[[], Any], int]:
    """Return a trial of a vector environment, and how many steps of one lander it makes: all that fly, autoresets too.

    Args:
        name: of the environment.
        count: steps of all landers together.
        policy: gives actions for what is observed; None draws them beforehand.
    """
    envs: Any = gymnasium.make_vec(name, num_envs=LANDERS, vectorization_mode="vector_entry_point")
    rng = np.random.default_rng(1)
    drawn = [rng.integers(0, envs.single_action_space.n, LANDERS) for _ in range(64)]

    def benchmark() -> Callable[[], None]:
        state = {"seen": envs.reset(seed=0)[0]}

        def run() -> None:
            for k in range(count):
                state["seen"] = envs.step(drawn[k % 64] if policy is None else policy(state["seen"]))[0]

        return run

    return benchmark, count * LANDERS


def vectors(is_quick: bool) -> Iterator[Row]:
    """Measure the vector environments against the single ones, a row at a time."""
    for name, count, min_mps, policy, what in (
        ("LanderVertical", 700, 2.0, None, "random actions"),
        ("LanderVertical", 700, None, straight_down, "a policy that lands"),
        ("LanderPad", 300, 0.2, None, "random actions"),
        ("LanderPad", 400, None, to_the_ground, "a policy that lands"),
    ):
        steps = count // 5 if is_quick else count
        vector, made = vector_steps_of(f"snr_sim/{name}-v0", steps, policy)
        alone = 500
        found = compare(steps_of(f"snr_sim/{name}-v0", alone), vector, rounds=3)
        single_s, vector_s = (found.shortest_s[0] / alone, found.shortest_s[1] / made)
        yield Row(
            name=f"{name}: steps of {LANDERS} at once, {what}",
            value=1e-6 / vector_s,
            unit="M/s",
            limit=min_mps,
            more_is_better=True,
            baseline=1e-6 / single_s,
            compared_to="the single environment with random actions",
            ratio=found.ratios[1] * alone / made,
            note="resets included; the ratio is that of times, smaller is faster",
        )


def tenth_of_a_second(landers: int) -> tuple[Benchmark, Benchmark, Benchmark]:
    """Return three trials: so many landers moved on by a step of `LanderPad`.

    One by one in the plant under MuJoCo, by MuJoCo's batch rollout, and as the trainer moves them.
    """
    env: Any = gymnasium.make("snr_sim/LanderPad-v0", engine="mujoco").unwrapped
    env.reset(options={"start": 1})
    plant, spec = env.plant, mujoco.mjtState.mjSTATE_FULLPHYSICS
    start, steps = plant.snapshot(), round(STEP_S / plant.step_s)
    model, data = plant._hull._model, plant._hull._data
    state = np.empty(mujoco.mj_stateSize(model, spec))
    mujoco.mj_getState(model, data, state, spec)
    states, pushes = np.tile(state, (landers, 1)), np.zeros((landers, steps, model.nv))
    pushes[:, :, 2] = 0.25 * plant.module.thrust_n
    task = PadBatchTask(env, 1)
    batch, throttle = task.scenario_starts(landers), np.full(landers, 0.25)

    def one_by_one() -> Callable[[], None]:
        plant.restore(start)
        plant.write("engine", EngineCommand(0.25))

        def run() -> None:
            for _ in range(landers * steps):
                plant.step(plant.step_s)

        return run

    def by_rollout() -> Callable[[], None]:
        pool, own = Rollout(nthread=0), mujoco.MjData(model)
        what = {"control_spec": int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)}
        return lambda: pool.rollout([model] * landers, [own], states, pushes, **what)

    def by_numpy() -> Callable[[], None]:
        return lambda: step(batch, throttle, np.zeros(landers), task.module, STEP_S)

    return one_by_one, by_rollout, by_numpy


def landings(name: str, landed: int, min_landed: int) -> Row:
    """Return the row that says how many unseen starts land after a training."""
    unit = f"of {len(UNSEEN)}"
    return Row(f"{name}: unseen starts that land", landed, unit, limit=float(min_landed), more_is_better=True)


def measure(is_quick: bool) -> Iterator[Row]:
    """Measure, a row at a time."""
    count, rounds = (1000, 3) if is_quick else (5000, 9)
    for continuous in (False, True):
        name = f"LunarLanderBox, {'continuous' if continuous else 'discrete'}: step"
        compatible = steps_of(COMPATIBLE, count, continuous=continuous)
        if importlib.util.find_spec("Box2D") is None:
            took_s = min(cpu_time_of(compatible) for _ in range(3))
            note = "beside nothing: Box2D is not here; pip install 'snr_sim[bench]'"
            yield Row(name=name, value=took_s / count * 1e6, unit="us", note=note)
            continue
        found = compare(steps_of(ORIGINAL, count, continuous=continuous), compatible, rounds=rounds)
        yield Row(
            name=name,
            value=found.shortest_s[1] / count * 1e6,
            unit="us",
            baseline=found.shortest_s[0] / count * 1e6,
            compared_to=f"gymnasium's {ORIGINAL} with Box2D",
            ratio=found.ratios[1],
            ratio_limit=0.5,
            note="resets included",
        )
    for name in ("LanderVertical", "LanderPad", "UrovDepthHold", "UrovStation"):
        steps = count // 10
        took_s = min(cpu_time_of(steps_of(f"snr_sim/{name}-v0", steps)) for _ in range(3))
        yield Row(name=f"{name}: step", value=took_s / steps * 1e6, unit="us", note="resets included")
    yield from vectors(is_quick)
    landers = 20 if is_quick else 60  # so that the one plant that flies for all of them stays in the air
    found = compare(*tenth_of_a_second(landers), rounds=rounds)
    for k, name in enumerate(("by MuJoCo's batch rollout", "in the trainer's batch"), start=1):
        yield Row(
            name=f"0.1 s of one of {landers} landers, {name}",
            value=found.shortest_s[k] / landers * 1e6,
            unit="us",
            baseline=found.shortest_s[0] / landers * 1e6,
            compared_to="the plant under MuJoCo, one by one",
            ratio=found.ratios[k],
        )
    env = gymnasium.make("snr_sim/LanderVertical-v0").unwrapped
    table = new_table()
    start_s = time.process_time()
    train_vertical(table, vertical_batch_task(env))
    took_s = time.process_time() - start_s
    landed = sum(end["success"] for end in evaluate(env, table.act, UNSEEN))
    yield Row(
        name="LanderVertical: training in a batch",
        value=took_s,
        unit="s",
        limit=5.0,
        note=f"seed {BatchTraining.seed}",
    )
    yield landings("LanderVertical", landed, min_landed=99)
    if not is_quick:
        env = gymnasium.make("snr_sim/LanderPad-v0").unwrapped
        policy = PadPolicy()
        start_s = time.process_time()
        train_pad(policy, env)
        took_s = time.process_time() - start_s
        landed = sum(end["success"] for end in evaluate(env, policy.act, UNSEEN))
        yield Row(
            name="LanderPad: training by tiles",
            value=took_s,
            unit="s",
            limit=300.0,
            note=f"seed {PadTraining.seed}",
        )
        yield landings("LanderPad", landed, min_landed=90)
