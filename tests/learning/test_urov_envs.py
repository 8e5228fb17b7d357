"""The underwater vehicle as a gymnasium environment. What every environment keeps is tested in test_lander_envs.py."""

import math
from typing import Any

import gymnasium
import numpy as np
import pytest

import snr_sim.learning  # noqa: F401 - makes the names known
from snr_sim.learning.urov_envs import EFFORT_WEIGHT, Rate
from tests.lanes import slow


def made(name: str) -> Any:
    return gymnasium.make(f"snr_sim/{name}-v0").unwrapped


def run_episode(env: Any, policy: Any, start: int) -> tuple[float, dict[str, Any]]:
    """Flies an episode; returns the sum of rewards, and how it ended."""
    observation, _ = env.reset(options={"start": start})
    total, is_over = 0.0, False
    while not is_over:
        action = np.clip(policy([float(one) for one in observation]), -1.0, 1.0).astype(np.float32)
        observation, reward, is_ended, is_over, info = env.step(action)
        total += reward
        assert not is_ended
    return total, info


def depth_holder() -> Any:
    wound_up = 0.0

    def policy(seen: list[float]) -> Any:
        nonlocal wound_up
        down_m, _, sink_mps, *_ = seen
        if abs(down_m) < 0.5:
            wound_up += 0.1 * down_m
        return np.array([1.2 * sink_mps - 2.0 * down_m - 0.7 * wound_up])

    return policy


def station_keeper() -> Any:
    wound_up = np.zeros(3)

    def policy(seen: list[float]) -> Any:
        nonlocal wound_up
        place_m, turn_rad, speed_mps, yaw_radps = np.array(seen[:3]), seen[3], np.array(seen[4:7]), seen[7]
        wound_up = np.clip(wound_up + 0.1 * place_m, -2.0, 2.0)
        push = [0.5, 0.5, 2.0] * place_m - [0.8, 0.8, 1.2] * speed_mps + [0.1, 0.1, 0.5] * wound_up
        return np.array([push[0], push[1], -push[2], 1.2 * turn_rad - 0.7 * yaw_radps])

    return policy


@pytest.mark.parametrize(
    ("name", "policy_of", "start"),
    [
        ("UrovDepthHold", depth_holder, 0),
        slow("UrovDepthHold", depth_holder, 9),
        ("UrovStation", station_keeper, 9),
        slow("UrovStation", station_keeper, 0),
    ],
)
def test_observation_suffices_to_meet_scenario_criterion(name: str, policy_of: Any, start: int) -> None:
    env = made(name)
    _, info = run_episode(env, policy_of(), start)
    assert (info["outcome"], info["success"]) == ("held", True)


@pytest.mark.parametrize("name", ["UrovDepthHold", slow("UrovStation")])
def test_zero_action_fails_criterion_with_negative_return(name: str) -> None:
    env = made(name)
    total, info = run_episode(env, lambda seen: np.zeros(env.action_space.shape), 0)
    assert (info["outcome"], info["success"]) == ("failed", False)
    assert info["reason"]
    assert total < -60.0  # the policies above pay 20 to 55


def test_reward_of_zero_action_is_distance_only() -> None:
    env = made("UrovDepthHold")
    env.reset(seed=4)
    _, reward, *_ = env.step(np.array([0.0], np.float32))
    assert reward == -env.error_m()
    _, reward, *_ = env.step(np.array([-0.5], np.float32))
    assert reward == pytest.approx(-env.error_m() - 0.25 * EFFORT_WEIGHT)


@pytest.mark.parametrize(("axis", "seen"), [(0, 4), (1, 5), (2, 6), (3, 7)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_each_action_axis_pushes_in_its_direction(axis: int, seen: int, sign: float) -> None:
    env = made("UrovStation")
    env.reset(options={"start": 1})
    action = np.zeros(4, np.float32)
    action[axis] = 0.5 * sign
    for _ in range(15):
        observation, *_ = env.step(action)
    speed = -observation[6] if seen == 6 else observation[seen]  # up is the way of less depth
    assert speed * sign > 0.3
    assert all(abs(observation[other]) < 0.5 * speed * sign for other in (4, 5, 6, 7) if other != seen)


def test_first_observation_is_after_arming() -> None:
    env = made("UrovStation")
    _, info = env.reset(seed=1)
    assert info["time_s"] == env.plant.time_s == 2.0
    assert all(esc.is_armed for esc in env.plant.thrusters.escs)


def test_target_depth_equals_pilot_script() -> None:
    env = made("UrovDepthHold")
    env.reset(seed=1)
    assert env.target_m == 1.0
    for _ in range(40):
        env.step(np.array([0.0], np.float32))
    assert env.target_m == 3.0


def test_planar_vehicle_has_same_spaces_and_holds_depth() -> None:
    env = gymnasium.make("snr_sim/UrovDepthHold-v0", engine="pymunk").unwrapped
    _, info = run_episode(env, depth_holder(), 3)
    assert info["success"]


def test_rate_is_smoothed_over_time_constant() -> None:
    rate = Rate(smoothing_s=0.5)
    rate.update(0.0, 0.0)
    for i in range(1, 101):
        newest = rate.update(0.02 * i, 0.01 * i)
    assert newest == pytest.approx(2.0 * (1.0 - math.exp(-1.0 / 0.5)), rel=0.02)  # of a first-order lag after 1 s
