"""Learning to land in the plane by tiles: it learns, its file is safe, and it flies in a node as it did here.

How well it lands after two minutes of learning is measured by `snr bench learning`, and checked here in nightly.
"""

import json
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from msgspec import structs

import snr_sim.learning  # noqa: F401 - makes the names known
from snr_sim.learning.batch_training import new_table
from snr_sim.learning.lander_envs import PAD_THROTTLES, PAD_TURNS, pad_command
from snr_sim.learning.pad_training import BURN_AXES, LEAN_AXES, PadPolicy, PadTraining, evaluate_policy, train_pad
from snr_sim.learning.q_table import QTable
from snr_sim.learning.tabular import evaluate
from snr_sim.prelude.errors import ParameterError, RecordingError
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

SHORT = PadTraining(landers=192, steps=500, eval_episodes=100)


@pytest.fixture(scope="module")
def env() -> Any:
    return gymnasium.make("snr_sim/LanderPad-v0").unwrapped


@pytest.fixture(scope="module")
def learned(env: Any) -> PadPolicy:
    policy = PadPolicy()
    train_pad(policy, env, SHORT)
    return policy


def test_short_training_improves_landings(env: Any, learned: PadPolicy) -> None:
    before, after = (evaluate_policy(policy, env, 200, seed=3) for policy in (PadPolicy(), learned))
    assert before.slow + before.straight < 0.1
    assert after.slow + after.straight > before.slow + before.straight + 0.1


@pytest.mark.slow
def test_same_seed_gives_same_policy_and_other_seed_another(env: Any, learned: PadPolicy) -> None:
    again, other = PadPolicy(), PadPolicy()
    train_pad(again, env, SHORT)
    train_pad(other, env, PadTraining(landers=192, steps=500, eval_episodes=100, seed=1))
    assert np.array_equal(again.burn.weights, learned.burn.weights)
    assert np.array_equal(again.lean.weights, learned.lean.weights)
    assert not np.array_equal(other.lean.weights, learned.lean.weights)


@pytest.mark.parametrize(
    "wrong", [{"steps": 0}, {"landers": 1.5}, {"seed": -1}, {"eval_interval": 0}, {"min_step_size": (0.05, -0.1)}]
)
def test_invalid_training_raises_before_it_begins(wrong: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=f"A training with {next(iter(wrong))}="):
        PadTraining(**wrong)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [0, 1])
def test_full_training_lands_90_of_100_unseen_starts(env: Any, seed: int) -> None:
    policy = PadPolicy()
    train_pad(policy, env, PadTraining(seed=seed))
    assert sum(end["success"] for end in evaluate(env, policy.act, range(1, 101))) >= 90


def test_policy_after_contact_turns_all_off(learned: PadPolicy) -> None:
    learned.lean.weights[:, 2] += 100.0  # it would turn, if it were asked
    try:
        for contact in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
            command = pad_command(learned.act([0.0, 0.1, 0.0, -1.0, 0.0, 0.0, *contact, 100.0]))
            assert (command.throttle, command.attitude) == (0.0, 0.0)
        assert pad_command(learned.act([0.0, 0.1, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 100.0])).attitude == 1.0
    finally:
        learned.lean.weights[:, 2] -= 100.0


def test_loaded_policy_equals_saved_one(learned: PadPolicy, tmp_path: Path) -> None:
    learned.save(tmp_path / "policy.npz")
    found = PadPolicy.load(tmp_path / "policy.npz")
    assert np.array_equal(found.burn.weights, learned.burn.weights)
    assert np.array_equal(found.lean.weights, learned.lean.weights)
    assert found.burn.coder.axes == learned.burn.coder.axes
    assert found.made_by == repr(SHORT)


def test_table_is_not_a_policy_and_policy_is_not_a_table(tmp_path: Path, learned: PadPolicy) -> None:
    """Damaged and malicious files are tried in test_q_table.py: both are read by the same code."""
    new_table().save(tmp_path / "table.npz")
    with pytest.raises(RecordingError, match="was learned in snr_sim/LanderVertical-v0, not in snr_sim/LanderPad-v0"):
        PadPolicy.load(tmp_path / "table.npz")
    learned.save(tmp_path / "whole.npz")
    with pytest.raises(RecordingError, match="table of action values"):
        QTable.load(tmp_path / "whole.npz")


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({"burn": BURN_AXES[::-1]}, "burn by vz_mps, altitude_m; what flies looks at altitude_m, vz_mps"),
        ({"burn": BURN_AXES[:1]}, "decides how to burn by altitude_m; what"),
        ({"lean": (*LEAN_AXES, BURN_AXES[0])}, "decides how to lean by vx_mps, attitude_rad, rate_radps, altitude_m"),
    ],
)
def test_policy_with_other_axes_raises_at_load(axes: dict[str, Any], message: str, tmp_path: Path) -> None:
    PadPolicy(**{name: [structs.replace(axis, intervals=3) for axis in given] for name, given in axes.items()}).save(
        tmp_path / "policy.npz"
    )
    with pytest.raises(RecordingError, match=message):
        PadPolicy.load(tmp_path / "policy.npz")


@pytest.mark.parametrize(("field", "value"), [("intervals", 2**62), ("intervals", 10**6), ("tilings", 10**30)])
def test_too_many_tiles_raise_before_allocation(field: str, value: int, tmp_path: Path) -> None:
    path, short = tmp_path / "policy.npz", [structs.replace(axis, intervals=3) for axis in BURN_AXES]
    PadPolicy(burn=short, lean=[structs.replace(axis, intervals=3) for axis in LEAN_AXES]).save(path)
    with np.load(path) as whole:
        arrays = {name: whole[name] for name in whole.files}
    about = json.loads(arrays["about"].tobytes())
    (about["burn"][0] if field == "intervals" else about)[field] = value
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    np.savez(path, **arrays)
    with pytest.raises(RecordingError, match="is not a policy of tiles"):
        PadPolicy.load(path)


def test_policy_in_node_lands_as_in_environment_bitwise(env: Any, learned: PadPolicy, tmp_path: Path) -> None:
    observation, _ = env.reset(options={"start": 5})
    over = False
    while not over:
        observation, _, *ended, info = env.step(learned.act(observation.tolist()))
        over = any(ended)
    learned.save(tmp_path / "policy.npz")
    options = {"policy": str(tmp_path / "policy.npz")}
    simulation = prepare(Request("lander_pad", seed=5, controller="q", options=options))
    plant: Any = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert result.outcome == info["outcome"]
    assert plant.touchdown == env.plant.touchdown
    assert plant.fuel_kg == env.plant.fuel_kg


def test_controller_without_file_raises_with_command() -> None:
    simulation = prepare(Request("lander_pad", controller="q"))
    with pytest.raises(ParameterError, match=r"learn_pad\.py"):
        simulation.config(simulation.plant())


def test_actions_equal_those_of_environment() -> None:
    commands = [pad_command(action) for action in range(9)]
    assert [command.throttle for command in commands] == [one for one in PAD_THROTTLES for _ in PAD_TURNS]
    assert [command.attitude for command in commands] == list(PAD_TURNS) * 3
