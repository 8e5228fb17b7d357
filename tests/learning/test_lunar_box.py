"""The environment for code that was written for LunarLander-v3: by the book, and how near it is to the original.

What the original does is recorded in lunar_lander_v3.json, as Box2D is not among what the tests need. Where it is
(`pip install 'snr_sim[bench]'`), this records it again:

    python tests/learning/test_lunar_box.py --write
"""

import json
import math
import subprocess
import sys
import warnings
from importlib.metadata import version
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import snr_sim.learning  # noqa: F401 - makes the name known
from snr_sim.learning.lunar_box import LunarLanderBox
from snr_sim.learning.lunar_box_world import CHUNKS, PAD_Y, LunarBoxWorld
from snr_sim.prelude.errors import ParameterError

NAME = "snr_sim/LunarLanderBox-v0"
RECORDED_FILE = Path(__file__).with_name("lunar_lander_v3.json")
RECORDED = json.loads(RECORDED_FILE.read_text())
both_actions = pytest.mark.parametrize("continuous", [False, True], ids=["discrete", "continuous"])


@both_actions
def test_gymnasium_checker_passes(continuous: bool) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(NAME, render_mode="rgb_array", continuous=continuous).unwrapped)


def episode(seed: int, continuous: bool) -> list[Any]:
    env = gymnasium.make(NAME, continuous=continuous, enable_wind=True)
    env.action_space.seed(seed)
    observation, _ = env.reset(seed=seed)
    seen: list[Any] = [observation.tolist()]
    is_over = False
    while not is_over:
        observation, reward, *ended, _ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        seen.append([observation.tolist(), reward, *ended])
        is_over = any(ended)
    return seen


@pytest.mark.slow
@both_actions
def test_same_seed_gives_same_episode_in_another_process(continuous: bool) -> None:
    mine = episode(5, continuous)
    assert episode(5, continuous) == mine
    assert episode(6, continuous) != mine
    code = (
        "import json, sys; sys.path.insert(0, sys.argv[1])\n"
        "from test_lunar_box import episode\n"
        f"print(json.dumps(episode(5, {continuous})))"
    )
    printed = subprocess.check_output([sys.executable, "-c", code, str(Path(__file__).parent)], text=True)
    assert json.loads(printed) == json.loads(json.dumps(mine))


@both_actions
def test_episode_is_independent_of_previous_ones(continuous: bool) -> None:
    """The engine keeps contacts, orders of shapes and pushes of joints; none may outlive a landing or a crash."""
    used = gymnasium.make(NAME, continuous=continuous)
    for seed in range(12):
        assert landing(used, seed, continuous) == landing(gymnasium.make(NAME, continuous=continuous), seed, continuous)


def landing(env: Any, seed: int, continuous: bool) -> list[bytes]:
    seen, _ = env.reset(seed=seed)
    recorded, ended = [seen.tobytes()], [False]
    while not any(ended):
        # Every fourth lands with its engines off: it crashes, or comes to lie on the ground.
        off = np.zeros(2, np.float32) if continuous else 0
        seen, _, *ended, _ = env.step(off if seed % 4 == 3 else published_policy(seen, continuous))
        recorded.append(seen.tobytes())
    return recorded


# What LunarLander-v3 of gymnasium 1.4 with Box2D 2.3.10 observes at the start, and after 40 steps of 0 2 0 1 2 3.
ORIGINAL = {
    0: ([0.0057, 1.399, 0.578, -0.5283, -0.0066, -0.1309], [0.2516, 0.7056, 0.7283, -1.0024, -0.24, -0.0757]),
    1: ([-0.0027, 1.4173, -0.2753, 0.2835, 0.0032, 0.0624], [-0.129, 1.4473, -0.3854, -0.185, 0.0858, 0.054]),
    2: ([-0.0011, 1.4144, -0.1089, 0.1554, 0.0013, 0.0247], [-0.0459, 1.3164, -0.1515, -0.3548, 0.0935, 0.0635]),
}


@pytest.mark.parametrize("seed", list(ORIGINAL))
def test_flight_until_contact_is_close_to_original(seed: int) -> None:
    """Box2D turns the legs out within the first steps, which nudges the hull; each nudge of tilt grows with time."""
    env = gymnasium.make(NAME)
    start, later = ORIGINAL[seed]
    observation, _ = env.reset(seed=seed)
    np.testing.assert_allclose(observation[:6], start, atol=0.005)
    for k in range(40):
        observation, *_ = env.step((0, 2, 0, 1, 2, 3)[k % 6])
    np.testing.assert_allclose(observation[:2], later[:2], atol=0.005)
    np.testing.assert_allclose(observation[2:6], later[2:], atol=0.01)


def published_policy(seen: Any, continuous: bool) -> Any:
    """The control law that the original's documentation demonstrates: point towards the pad, fall as fast as is fit."""
    x, y, vx, vy, angle, turn, left, right = (float(one) for one in seen)
    lean = max(-0.4, min(0.4, 0.5 * x + vx))
    turning, climbing = 0.5 * (lean - angle) - turn, 0.5 * (0.55 * abs(x) - y) - 0.5 * vy
    if left or right:
        turning, climbing = 0.0, -0.5 * vy
    if continuous:
        return np.clip(np.array([20.0 * climbing - 1.0, -20.0 * turning], np.float32), -1.0, 1.0)
    if climbing > abs(turning) and climbing > 0.05:
        return 2
    if turning < -0.05:
        return 3
    return 1 if turning > 0.05 else 0


def returns_of(name: str, continuous: bool, seeds: int = 200) -> list[float]:
    """What the published policy scores with each seed."""
    env, scores = gymnasium.make(name, continuous=continuous), []
    for seed in range(seeds):
        seen, _ = env.reset(seed=seed)
        score, ended = 0.0, [False]
        while not any(ended):
            seen, reward, *ended, _ = env.step(published_policy(seen, continuous))
            score += float(reward)
        scores.append(round(score, 2))
    return scores


def tilts_of(name: str, flights: int = 30) -> list[list[float]]:
    """The tilt after every fifth random action, until something touches; for each seed."""
    env, recorded = gymnasium.make(name), []
    for seed in range(flights):
        rng = np.random.default_rng(seed)
        env.reset(seed=seed)
        tilts: list[float] = []
        for k in range(1, 1000):
            seen, _, *ended, _ = env.step(int(rng.integers(4)))
            if any(ended) or seen[6] or seen[7]:
                break
            if k % 5 == 0:
                tilts.append(round(float(seen[4]), 4))
        recorded.append(tilts)
    return recorded


def test_random_actions_tilt_as_in_original_until_contact() -> None:
    wrong = [
        np.abs(np.array(ours[:shorter]) - original[:shorter])
        for ours, original in zip(tilts_of(NAME), RECORDED["tilts"], strict=True)
        if (shorter := min(len(ours), len(original)))
    ]
    assert len(wrong) == 30
    assert float(np.mean([flight.mean() for flight in wrong])) <= 0.003  # 0.0015 as measured; 0.01 would do
    assert max(float(flight.max()) for flight in wrong) <= 0.015


@pytest.mark.slow
@both_actions
def test_published_policy_scores_as_in_original(continuous: bool) -> None:
    original = RECORDED["continuous" if continuous else "discrete"]
    gained = np.array(returns_of(NAME, continuous)) - original
    assert abs(float(gained.mean())) <= 2.0 * float(gained.std(ddof=1)) / math.sqrt(len(gained))


@pytest.mark.parametrize("action", [1, 2, 3])
def test_burn_changes_angle_by_rate_only(action: int) -> None:
    env: Any = gymnasium.make(NAME).unwrapped
    env.reset(seed=0)
    for _ in range(10):
        before = env.world.angle_rad
        env.step(action)
        assert env.world.angle_rad - before == pytest.approx(env.world.turn_radps / 50.0, abs=2e-5)


def test_last_reward_is_100_at_rest_and_minus_100_at_crash() -> None:
    env: Any = gymnasium.make(NAME).unwrapped
    seen, _ = env.reset(seed=0)
    is_over = False
    while not is_over:
        seen, reward, is_over, _, _ = env.step(published_policy(seen, False))
    assert reward == 100.0
    assert seen[6:].tolist() == [1.0, 1.0]
    assert env.world.is_asleep

    env.reset(seed=0)
    is_over = False
    while not is_over:
        _, reward, is_over, _, _ = env.step(0)
    assert reward == -100.0
    assert env.world.is_crashed


def test_leg_that_leaves_one_of_two_pieces_of_ground_counts_as_off_it() -> None:
    """As in the original, whose listener keeps the last event of a leg, not how many pieces it touches."""
    world = LunarBoxWorld(-10.0)
    world.begin([PAD_Y] * CHUNKS)
    seen = set()
    for _ in range(300):
        world.step()
        if any(world._touching[1:]):
            world.hull.velocity = 2.0, world.hull.velocity[1]  # over the joints of the ground
        seen.add((world._touching[1], world.contacts[0]))
    assert {(0, False), (1, True), (1, False)} <= seen


def test_leaving_world_sideways_terminates() -> None:
    env: Any = gymnasium.make(NAME, continuous=True).unwrapped
    env.reset(seed=1)
    env.world.hull.velocity = 60.0, 20.0
    is_over = False
    while not is_over:
        seen, reward, is_over, _, _ = env.step((-1.0, 0.0))
    assert (abs(float(seen[0])) >= 1.0, reward) == (True, -100.0)
    assert not env.world.is_crashed


def test_reward_is_potential_difference_less_engine_cost() -> None:
    rewards = {}
    for action in range(4):
        env: Any = gymnasium.make(NAME).unwrapped
        env.reset(seed=7)
        before = env._potential
        _, reward, *_ = env.step(action)
        rewards[action] = reward - (env._potential - before)
    assert rewards == pytest.approx({0: 0.0, 1: -0.03, 2: -0.3, 3: -0.03})


def test_hovering_is_truncated_after_1000_steps() -> None:
    env: Any = gymnasium.make(NAME, continuous=True)
    env.reset(seed=0)
    for step in range(1, 1001):
        env.unwrapped.world.hull.velocity = 0.0, 0.0  # held up
        _, _, *ended, _ = env.step((-1.0, 0.0))
        assert ended == [False, step == 1000]


@pytest.mark.parametrize("action", [4, -1, 1.0, "2", None, np.array([1]), math.nan])
def test_invalid_action_raises_with_valid_actions(action: Any) -> None:
    env = gymnasium.make(NAME).unwrapped
    env.reset(seed=0)
    with pytest.raises(ParameterError, match="0, 1, 2 or 3"):
        env.step(action)
    env.step(np.int64(3))


@pytest.mark.parametrize("action", [0, (0.0,), (0.0, 0.0, 0.0), ("a", "b"), (math.nan, 0.0), (0.0, math.inf), None])
def test_continuous_action_without_two_numbers_raises(action: Any) -> None:
    env = gymnasium.make(NAME, continuous=True).unwrapped
    env.reset(seed=0)
    with pytest.raises(ParameterError, match="two numbers from -1 to 1"):
        env.step(action)
    env.step((3.0, -2.0))  # counts as (1, -1), as in the original


def test_step_outside_episode_raises() -> None:
    env = gymnasium.make(NAME).unwrapped
    with pytest.raises(ParameterError, match="call reset"):
        env.step(0)
    env.reset(seed=0)
    while not env.step(0)[2]:
        pass
    with pytest.raises(ParameterError, match="call reset"):
        env.step(0)


@pytest.mark.parametrize(
    "kwargs",
    [{"gravity": 1.0}, {"gravity": -12.0}, {"wind_power": 21.0}, {"turbulence_power": -1.0}, {"render_mode": "human"}],
)
def test_invalid_argument_raises_with_name(kwargs: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=next(iter(kwargs))):
        LunarLanderBox(**kwargs)


def test_wind_moves_lander_sideways() -> None:
    def at_end(enable_wind: bool) -> float:
        env = gymnasium.make(NAME, enable_wind=enable_wind, wind_power=20.0).unwrapped
        env.reset(seed=11)
        for _ in range(60):
            seen, *_ = env.step(0)
        return float(seen[0])

    assert abs(at_end(True) - at_end(False)) > 0.05


def test_wind_without_power_changes_nothing() -> None:
    ends = []
    for kwargs in ({}, {"enable_wind": True, "wind_power": 0.0, "turbulence_power": 0.0}):
        env: Any = gymnasium.make(NAME, **kwargs)
        env.reset(seed=11)
        env.unwrapped._draw = np.random.default_rng(1).random  # the wind draws two numbers more
        ends.append([env.step(k % 4)[0].tolist() for k in range(30)][-1])
    assert ends[0] == pytest.approx(ends[1], abs=0.05)


def record() -> None:
    """Record what gymnasium's own LunarLander-v3 does, with Box2D."""
    name = "LunarLander-v3"
    recorded = {"tilts": tilts_of(name), "discrete": returns_of(name, False), "continuous": returns_of(name, True)}
    by = {package: version(package) for package in ("gymnasium", "box2d")}
    RECORDED_FILE.write_text(json.dumps({"by": by, **recorded}, indent=None) + "\n")


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        record()
