"""Environments as Stable-Baselines3 takes them. It brings torch, 5 GB on Linux, so `dev` does not have it.

pip install -e '.[dev,rl]' && python -m pytest -m nightly tests/learning/test_stable_baselines3.py
"""

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest

import snr_sim.learning  # noqa: F401 - makes the names known
from snr_sim.learning.gym import ENVIRONMENTS

pytestmark = [pytest.mark.nightly, pytest.mark.filterwarnings("default")]  # torch has warnings of its own


@pytest.fixture(scope="module")
def sb3() -> Any:
    """Return Stable-Baselines3, imported when a test needs it: with torch that takes seconds."""
    pytest.importorskip("stable_baselines3.common.env_checker", reason="needs the extra 'rl'")
    return pytest.importorskip("stable_baselines3")


@pytest.mark.parametrize("name", list(ENVIRONMENTS))
def test_stable_baselines_checker_passes(sb3: Any, name: str) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sb3.common.env_checker.check_env(gymnasium.make(name, render_mode="rgb_array"))
    words = [str(one.message) for one in caught if "snr_sim" in str(one.filename) or "env_checker" in str(one.filename)]
    # Bounds of continuous actions are physical (a throttle is 0 to 1), not -1 to 1 for each.
    assert [text for text in words if "symmetric and normalized" not in text] == []


@pytest.mark.parametrize("name", list(ENVIRONMENTS))
def test_ppo_trains_without_wrapper(sb3: Any, name: str) -> None:
    model = sb3.PPO("MlpPolicy", name, n_steps=64, batch_size=64, n_epochs=1, seed=1, device="cpu")
    before = parameters_of(model)
    model.learn(128)
    assert model.num_timesteps == 128
    assert any(not np.array_equal(one, other) for one, other in zip(before, parameters_of(model), strict=True))


def test_briefly_trained_ppo_beats_random_policy(sb3: Any) -> None:
    """The mean return over unseen starts grows. By 33 to 43 with three seeds: it hovers, and does not crash."""
    envs = sb3.common.env_util.make_vec_env("snr_sim/LanderVertical-v0", n_envs=8, seed=3)
    far_sighted = {"gamma": 0.999, "gae_lambda": 0.98}  # a flight is hundreds of steps long
    model = sb3.PPO(
        "MlpPolicy",
        sb3.common.vec_env.VecNormalize(envs, gamma=far_sighted["gamma"]),
        n_steps=256,
        batch_size=256,
        ent_coef=0.01,
        seed=3,
        device="cpu",
        **far_sighted,
    )
    untrained = mean_return(model)
    model.learn(20_000)
    assert mean_return(model) > untrained + 20.0


def parameters_of(model: Any) -> list[Any]:
    return [one.detach().numpy().copy() for one in model.policy.parameters()]


def mean_return(model: Any, episodes: int = 20) -> float:
    """Of the policy without exploration, at starts that no training has seen."""
    env = gymnasium.make("snr_sim/LanderVertical-v0")
    total = 0.0
    for start in range(-episodes, 0):
        seen, _ = env.reset(options={"start": start})
        is_over = False
        while not is_over:
            action, _ = model.predict(model.get_env().normalize_obs(seen), deterministic=True)
            seen, reward, *ended, _ = env.step(action)
            total += float(reward) / episodes
            is_over = any(ended)
    return total
