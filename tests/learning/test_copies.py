"""Copies of environments, by `copy.deepcopy` and by `pickle`, continue as the original does."""

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import NormalizeReward, RecordEpisodeStatistics

from snr_sim.learning.gym import COMPATIBLE, ENVIRONMENTS
from tests.lanes import slow

every_environment = pytest.mark.parametrize("name", [*ENVIRONMENTS, COMPATIBLE])


def pickled(env: Any) -> Any:
    return pickle.loads(pickle.dumps(env))


either_way = pytest.mark.parametrize("duplicate", [copy.deepcopy, pickled])


def seen(env: Any, steps: int) -> list[Any]:
    """All observations of an agent that acts at random, across the ends of episodes, too."""
    recorded: list[Any] = []
    for _ in range(steps):
        observation, reward, *ended, info = env.step(env.action_space.sample())
        info.get("episode", {}).pop("t", None)  # how long it took, of RecordEpisodeStatistics
        recorded.append((observation.tolist(), reward, ended, info))
        if any(ended):
            recorded.append(env.reset()[0].tolist())
    return recorded


@pytest.mark.parametrize(
    ("is_wrapped", "duplicate"),
    [(True, copy.deepcopy), (False, pickled), slow(True, pickled), slow(False, copy.deepcopy)],
)
@every_environment
def test_copy_in_mid_episode_continues_as_original(
    name: str, is_wrapped: bool, duplicate: Callable[[Any], Any]
) -> None:
    env: Any = gymnasium.make(name)
    env = RecordEpisodeStatistics(NormalizeReward(env)) if is_wrapped else env.unwrapped
    env.action_space.seed(3)
    env.reset(seed=7)
    env.reset()
    seen(env, 20)
    twin = duplicate(env)
    assert type(twin) is type(env)
    assert twin.unwrapped is not env.unwrapped
    count = 20 if "Urov" in name else 150
    assert seen(twin, count) == seen(env, count)
    assert twin.spec == env.spec


@either_way
@every_environment
def test_copy_before_first_reset_can_be_reset(name: str, duplicate: Callable[[Any], Any]) -> None:
    env: Any = gymnasium.make(name)
    twin = duplicate(env)
    assert np.array_equal(twin.reset(seed=5)[0], env.reset(seed=5)[0])


def test_copy_of_ended_episode_has_ended() -> None:
    env: Any = gymnasium.make("snr_sim/LanderVertical-v0").unwrapped
    env.reset(options={"start": 0})
    while not env.step(0)[2]:
        pass
    twin = copy.deepcopy(env)
    assert twin.verdict == env.verdict
    assert twin.plant.snapshot() == env.plant.snapshot()


def test_copy_shares_no_state_with_original() -> None:
    env: Any = gymnasium.make("snr_sim/LanderPad-v0").unwrapped
    env.reset(seed=1)
    twin = copy.deepcopy(env)
    before = twin.plant.snapshot()
    seen(env, 10)
    assert twin.plant.snapshot() == before
    assert twin.np_random is not env.np_random


def test_copy_keeps_actions_as_they_were_given() -> None:
    """A training writes its actions into one array again and again."""
    for name in ("snr_sim/LanderPadContinuous-v0", COMPATIBLE):
        env: Any = gymnasium.make(name, **({"continuous": True} if name == COMPATIBLE else {}))
        env.reset(seed=1)
        action = np.zeros(env.action_space.shape, np.float32)
        for share in (0.9, 0.2, 0.6):
            action[0] = share
            env.step(action)
        action[:] = 0.0
        twin = copy.deepcopy(env)
        assert np.array_equal(twin.step(action)[0], env.step(action)[0]), name


@pytest.mark.slow
def test_pickle_continues_in_another_process(tmp_path: Path) -> None:
    env = gymnasium.make("snr_sim/UrovStation-v0")
    env.action_space.seed(3)
    env.reset(seed=2)
    seen(env, 5)
    (tmp_path / "env.pickle").write_bytes(pickle.dumps(env))
    code = (
        "import pickle, sys; sys.path.insert(0, sys.argv[1])\n"
        "from test_copies import seen\n"
        "print(seen(pickle.load(open(sys.argv[2], 'rb')), 5))"
    )
    where = [str(Path(__file__).parent), str(tmp_path / "env.pickle")]
    assert subprocess.check_output([sys.executable, "-c", code, *where], text=True).strip() == str(seen(env, 5))
