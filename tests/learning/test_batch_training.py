"""Many landers at once: the plant's physics, the environment's reward, and a policy that lands unseen starts."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import snr_sim.learning  # noqa: F401 - makes our environments known
from snr_sim.learning.batch_training import (
    BatchTraining,
    VerticalBatchTask,
    evaluate_table,
    new_table,
    train_vertical,
    vertical_batch_task,
)
from snr_sim.learning.discretiser import Discretiser
from snr_sim.learning.lander_envs import VERTICAL_THROTTLES
from snr_sim.learning.q_table import QTable
from snr_sim.learning.tabular import evaluate
from snr_sim.learning.vertical_batch import Landers, step
from snr_sim.plants.lander.gear import GearLimits
from snr_sim.plants.lander.lander_1d import Lander1D, VerticalStart
from snr_sim.prelude.errors import ParameterError, RecordingError
from snr_sim.prelude.signals import EngineCommand
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun


@pytest.fixture(scope="module")
def env() -> Any:
    return gymnasium.make("snr_sim/LanderVertical-v0").unwrapped


@pytest.fixture(scope="module")
def task(env: Any) -> VerticalBatchTask:
    return vertical_batch_task(env)


@pytest.fixture(scope="module")
def curve() -> list[tuple[int, float]]:
    return []


@pytest.fixture(scope="module")
def learned(task: VerticalBatchTask, curve: list[tuple[int, float]]) -> QTable:
    table = new_table()
    train_vertical(table, task, on_evaluation=lambda step, trial: curve.append((step, trial.landed)))
    return table


@pytest.fixture(scope="module")
def learned_curve(learned: QTable, curve: list[tuple[int, float]]) -> list[tuple[int, float]]:
    return curve


def test_batch_step_equals_plant(task: VerticalBatchTask) -> None:
    """Also where the tank runs dry within a step, and where the ground is met."""
    rng = np.random.default_rng(5)
    count = 400
    height, speed = rng.uniform(0.1, 8.0, count), rng.uniform(-30.0, 10.0, count)
    mass, fuel = rng.uniform(6900.0, 8500.0, count), rng.choice([0.0, 0.5, 2.0, 900.0], count)
    throttle = rng.choice([0.0, 0.25, 0.5, 1.0], count)
    after, touches, speeds = step(Landers(height, speed, mass, fuel), throttle, task.engine, 0.2)
    for i in range(count):
        start = VerticalStart(height[i], speed[i], mass[i], fuel[i])
        plant = Lander1D(lambda seed, start=start: start, task.engine, gear=GearLimits(1e9, 1e9))
        plant.write("engine", EngineCommand(throttle[i]))
        plant.step(0.2)
        assert bool(touches[i]) == (plant.touchdown is not None)
        if plant.touchdown is None:
            assert after.height_m[i] == pytest.approx(plant.height_m, abs=1e-9)
            assert after.velocity_mps[i] == pytest.approx(plant.velocity_mps, abs=1e-9)
            assert after.fuel_kg[i] == pytest.approx(plant.fuel_kg, abs=1e-9)
        else:
            runs_dry = 0.0 < fuel[i] < 10.0 and throttle[i] > 0.0
            assert speeds[i] == pytest.approx(plant.touchdown["vertical_mps"], abs=0.5 if runs_dry else 0.02)
    assert 50 < touches.sum() < 350


def test_batch_rewards_equal_environment(env: Any) -> None:
    env.reset(options={"start": 7})
    task = vertical_batch_task(env, start=7)
    rng, ended = np.random.default_rng(2), False
    while not ended:
        plant = env.plant
        before = Landers(
            *(np.array([one]) for one in (plant.height_m, plant.velocity_mps, plant.mass_kg, plant.fuel_kg))
        )
        action = int(rng.integers(0, 3))
        _, reward, ended, _, info = env.step(action)
        after, touches, speeds = step(before, np.array([VERTICAL_THROTTLES[action]]), task.engine, 0.2)
        landed = touches & (speeds <= 3.05)
        assert task.rewards(before, after, touches, landed)[0] == pytest.approx(reward, abs=1e-3 if ended else 1e-6)
    assert info["outcome"] == "crashed"


@pytest.mark.slow
def test_trained_table_lands_unseen_starts(env: Any, learned: QTable) -> None:
    ends = evaluate(env, learned.act, range(1, 101))
    assert sum(end["success"] for end in ends) >= 99


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [pytest.param(987_654_321 + i, marks=[pytest.mark.nightly] if i else []) for i in range(20)]
)
def test_trained_table_of_any_seed_lands_unseen_starts(seed: int, env: Any, task: VerticalBatchTask) -> None:
    table = new_table()
    train_vertical(table, task, BatchTraining(seed=seed))
    assert evaluate_table(table, task, 5000, seed=77).landed >= 0.995
    assert sum(end["success"] for end in evaluate(env, table.act, range(1, 101))) >= 99


def test_same_seed_gives_same_table(task: VerticalBatchTask) -> None:
    short = BatchTraining(landers=64, steps=60, eval_interval=20, eval_episodes=10)
    tables = [new_table(), new_table(), new_table()]
    for table, seed in zip(tables, (1, 1, 2), strict=True):
        train_vertical(table, task, BatchTraining(64, 60, seed, eval_episodes=10, eval_interval=20))
    assert short.seed == 0
    assert (tables[0].values == tables[1].values).all()
    assert (tables[0].values != tables[2].values).any()


def test_best_evaluated_table_is_kept(task: VerticalBatchTask) -> None:
    table = new_table()
    steps: list[int] = []
    trials = train_vertical(
        table,
        task,
        BatchTraining(256, 400, eval_episodes=100, eval_interval=50),
        lambda step, trial: steps.append(step),
    )
    assert steps == list(range(0, 401, 50))
    best = max(range(len(trials)), key=lambda i: (trials[i].landed, i))
    assert trials[best].landed > trials[0].landed
    assert evaluate_table(table, task, 100, seed=[0, steps[best]]) == trials[best]


@pytest.mark.slow
def test_learning_curve_rises_from_zero(learned_curve: list[tuple[int, float]]) -> None:
    steps, landed = zip(*learned_curve, strict=True)
    assert steps[0] == 0
    assert landed[0] < 0.02
    assert sum(0.02 < share < 0.98 for share in landed) >= 2
    assert landed[-2:] == (1.0, 1.0)


@pytest.mark.parametrize("steps", [1, 39, 41])
def test_short_training_is_evaluated_at_its_end(steps: int, task: VerticalBatchTask) -> None:
    table = new_table()
    assert len(train_vertical(table, task, BatchTraining(64, steps, eval_episodes=10, eval_interval=40))) >= 2
    assert table.visits.sum() == 64 * steps


def test_vertical_batch_task_ignores_current_plant() -> None:
    env: Any = gymnasium.make("snr_sim/LanderVertical-v0").unwrapped
    fresh = vars(vertical_batch_task(env))
    env.reset(seed=1)
    assert str(vars(vertical_batch_task(env))) == str(fresh)
    while not env.step(3)[2]:
        pass
    assert env.plant.fuel_kg < fresh["tank_kg"]
    assert str(vars(vertical_batch_task(env))) == str(fresh)


def test_non_finite_values_stop_training(task: VerticalBatchTask) -> None:
    table, broken = new_table(), VerticalBatchTask(task.engine, 0.0, 7000.0, (0.1, 0.1))  # no tank
    with pytest.raises(ParameterError, match="At step 1 a value is to become"), np.errstate(all="ignore"):
        train_vertical(table, broken, BatchTraining(16, 10, eval_episodes=2))
    assert not table.values.any()


@pytest.mark.parametrize(
    "wrong",
    [{"steps": 0}, {"steps": 1.5}, {"landers": True}, {"seed": -1}, {"eval_episodes": 0}, {"epsilon": (2.0, 0.1)}],
)
def test_invalid_training_raises_before_it_begins(wrong: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=f"A training with {next(iter(wrong))}="):
        BatchTraining(**wrong)


def run(**options: str) -> Any:
    simulation = prepare(Request("lander_vertical", seed=7, controller="q", options=options))
    plant: Any = simulation.plant()
    return SimulationRun(simulation, plant, simulation.config(plant)).run(), plant


def test_table_in_node_lands_as_in_environment(env: Any, learned: QTable, tmp_path: Path) -> None:
    learned.save(tmp_path / "policy.npz")
    result, plant = run(policy=str(tmp_path / "policy.npz"))
    assert evaluate(env, learned.act, [7])[0]["outcome"] == result.outcome == "landed"
    assert (plant.touchdown, plant.fuel_kg) == (env.plant.touchdown, env.plant.fuel_kg)


def test_controller_without_suitable_table_raises(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="requires --policy"):
        run()
    with pytest.raises(RecordingError, match="There is no file"):
        run(policy=str(tmp_path / "none.npz"))
    table = tmp_path / "table.npz"
    new_table().save(table)
    in_the_plane = prepare(Request("lander_pad", controller="q", options={"policy": str(table)}))
    with pytest.raises(RecordingError, match="was learned in snr_sim/LanderVertical-v0, not in snr_sim/LanderPad-v0"):
        in_the_plane.config(in_the_plane.plant())
    backwards = Discretiser(("velocity_mps", "altitude_m"), ((-5.0, 0.0), (10.0, 100.0)))
    new_table(backwards).save(table)
    with pytest.raises(RecordingError, match="over velocity_mps, altitude_m; what flies observes altitude_m"):
        run(policy=str(table))
