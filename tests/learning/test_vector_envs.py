"""Vector environments compared with as many single ones: observations, rewards, ends; the API's contract."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import snr_sim.learning  # noqa: F401 - makes the names known
from snr_sim.prelude.errors import ParameterError
from tests.bench.landing_policies import straight_down, to_the_ground
from tests.lanes import slow

VERTICAL, PAD = "snr_sim/LanderVertical-v0", "snr_sim/LanderPad-v0"
NEXT_STEP, SAME_STEP = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP
CONTINUOUS = {name: name.replace("-v0", "Continuous-v0") for name in (VERTICAL, PAD)}
every_vector = pytest.mark.parametrize("name", [VERTICAL, CONTINUOUS[VERTICAL], PAD, CONTINUOUS[PAD]])


def vector(name: str, count: int, **kwargs: Any) -> Any:
    return gymnasium.make_vec(name, num_envs=count, vectorization_mode="vector_entry_point", **kwargs)


def singles(name: str, count: int, mode: AutoresetMode = AutoresetMode.NEXT_STEP) -> Any:
    kwargs = {"autoreset_mode": mode}
    return gymnasium.make_vec(name, num_envs=count, vectorization_mode="sync", vector_kwargs=kwargs)


def actions_for(name: str, seen: Any, rng: np.random.Generator, space: Any) -> Any:
    """By turns lands, acts at random, and repeats one action: pushes or falls, and turns over."""
    if "Continuous" in name:
        return rng.uniform(space.low, space.high).astype(np.float32)
    actions = straight_down(seen) if name == VERTICAL else to_the_ground(seen)
    actions[1::4] = rng.integers(0, space.nvec[0], len(actions[1::4]))
    actions[2::4] = space.nvec[0] - 1
    actions[3::8] = 0
    return actions


def same_infos(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return one.keys() == other.keys() and all(
        same_infos(one[key], other[key])
        if isinstance(one[key], dict)
        else str(np.asarray(one[key]).tolist()) == str(np.asarray(other[key]).tolist())
        for key in one
    )


@pytest.mark.parametrize(
    ("name", "mode"),
    [
        (VERTICAL, NEXT_STEP),
        (CONTINUOUS[VERTICAL], SAME_STEP),
        (PAD, SAME_STEP),
        slow(VERTICAL, SAME_STEP),
        slow(CONTINUOUS[VERTICAL], NEXT_STEP),
        slow(PAD, NEXT_STEP),
        slow(CONTINUOUS[PAD], NEXT_STEP),
        slow(CONTINUOUS[PAD], SAME_STEP),
    ],
)
def test_vector_equals_single_environments(name: str, mode: AutoresetMode) -> None:
    """Also at the ground, for the plant itself takes over there; rewards differ by rounding."""
    outcomes = outcomes_of_both(name, mode, {})
    if "Continuous" not in name:
        assert {"landed", "crashed"} <= outcomes


@pytest.mark.parametrize(
    ("name", "mode"), [(VERTICAL, SAME_STEP), slow(VERTICAL, NEXT_STEP), slow(PAD, NEXT_STEP), slow(PAD, SAME_STEP)]
)
def test_dispersed_vector_equals_single_environments(name: str, mode: AutoresetMode) -> None:
    spread = dict.fromkeys(gymnasium.make(name).unwrapped.plant.SCALABLE, 0.1)  # type: ignore[attr-defined]
    factors = {"thrust_n": spread.pop("thrust_n") + 0.85}
    assert "landed" in outcomes_of_both(name, mode, {"dispersion": spread, "factors": factors})


def outcomes_of_both(name: str, mode: AutoresetMode, options: dict[str, Any]) -> set[str]:
    """Compare some as one vector with as many single ones; return how their episodes have ended."""
    count, steps = (8, 420) if "Vertical" in name else (6, 330)
    ours, theirs = vector(name, count, autoreset_mode=mode), singles(name, count, mode)
    (seen, infos), (expected, expected_infos) = (one.reset(seed=5, options=options) for one in (ours, theirs))
    assert np.array_equal(seen, expected)
    assert same_infos(infos, expected_infos)
    rng, outcomes = np.random.default_rng(3), set[str]()
    for k in range(steps):
        actions = actions_for(name, seen, rng, ours.action_space)
        (seen, rewards, *ended, infos), (expected, expected_rewards, *expected_end, expected_infos) = (
            envs.step(actions) for envs in (ours, theirs)
        )
        assert np.array_equal(seen, expected), k
        assert np.array_equal(ended, expected_end), k
        np.testing.assert_allclose(rewards, expected_rewards, rtol=0.0, atol=1e-9)
        assert same_infos(infos, expected_infos), k
        final = infos.get("final_info", infos)
        outcomes.update(final["outcome"][final["_outcome"]] if "outcome" in final else ())
    return outcomes


@pytest.mark.slow
@pytest.mark.unmeasured
@pytest.mark.parametrize("name", [VERTICAL, pytest.param(PAD, marks=pytest.mark.nightly)])  # four times as long
def test_verdicts_of_100_seeds_equal_single_environment(name: str) -> None:
    starts = list(range(1, 101))
    found = []
    for envs in (vector(name, 100), singles(name, 100)):
        seen, _ = begun(envs) if hasattr(envs, "envs") else envs.reset(options={"start": starts})
        rng, verdicts = np.random.default_rng(1), [""] * 100
        while not all(verdicts):
            actions = straight_down(seen) if name == VERTICAL else to_the_ground(seen)
            wrong = rng.random(100) < 0.1  # so that not all land
            actions = np.where(wrong & (np.arange(100) % 3 == 0), 0, actions)
            seen, _, terminated, truncated, infos = envs.step(actions)
            for i in np.flatnonzero(terminated | truncated):
                verdicts[i] = verdicts[i] or infos["outcome"][i]
        found.append(verdicts)
    assert sum(one == other for one, other in zip(*found, strict=True)) >= 99
    assert {"landed", "crashed"} <= set(found[0])


def begun(envs: Any) -> tuple[Any, None]:
    """Begins as many single environments as there are at the starts 1, 2, 3, ..."""
    envs.reset()
    return np.stack([env.reset(options={"start": 1 + i})[0] for i, env in enumerate(envs.envs)]), None


@every_vector
def test_vector_implements_gymnasium_contract(name: str) -> None:
    envs = RecordEpisodeStatistics(vector(name, 3))
    assert envs.num_envs == 3
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert envs.unwrapped.spec.id == name
    single = gymnasium.make(name)
    assert envs.single_observation_space == single.observation_space
    assert envs.single_action_space == single.action_space
    first, _ = envs.reset(seed=1)
    assert envs.observation_space.contains(first)
    again, _ = envs.reset(seed=1)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, envs.reset()[0])
    envs.action_space.seed(1)
    seen, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    assert envs.observation_space.contains(seen)
    assert (rewards.dtype, terminated.dtype, truncated.dtype) == (np.float64, bool, bool)
    assert rewards.shape == terminated.shape == truncated.shape == infos["time_s"].shape == (3,)
    envs.close()


def test_make_vec_selects_vector_environment() -> None:
    assert type(gymnasium.make_vec(PAD, num_envs=2).unwrapped).__name__ == "LanderPadVector"


def test_returned_arrays_do_not_change_later() -> None:
    envs = vector(PAD, 4)
    recorded = [envs.reset(seed=1), *(envs.step(np.full(4, 4)) for _ in range(2))]
    copies = [[np.copy(one) for one in each[:-1]] for each in recorded]
    for _ in range(3):
        envs.step(np.full(4, 8))
    assert all(
        np.array_equal(a, b)
        for each, copy in zip(recorded, copies, strict=True)
        for a, b in zip(each, copy, strict=False)
    )


def test_step_limit_truncates_without_outcome() -> None:
    envs = vector(VERTICAL, 2, max_episode_steps=3)
    envs.reset(seed=1)
    ends = [envs.step(np.array([3, 3])) for _ in range(4)]
    assert [end[3].tolist() for end in ends] == [[False] * 2, [False] * 2, [True] * 2, [False] * 2]
    assert "outcome" not in ends[2][4]
    assert ends[3][4]["time_s"].tolist() == [0.0, 0.0]


def test_scenario_time_limit_is_reported_as_timeout() -> None:
    envs = vector(CONTINUOUS[VERTICAL], 1)
    seen, _ = envs.reset(options={"start": 0})
    truncated = np.zeros(1, bool)
    while not truncated.any():
        hover = np.clip(0.28 - 0.05 * seen[:, 1:], 0.0, 1.0).astype(np.float32)
        seen, _, terminated, truncated, infos = envs.step(hover)
        assert not terminated.any()
    assert (infos["outcome"][0], infos["time_s"][0]) == ("timeout", 240.0)


def test_leaving_region_is_lost_in_both() -> None:
    """Tilted, at full throttle: the engine pushes it out sideways."""
    kinds = [vector(CONTINUOUS[PAD], 2), singles(CONTINUOUS[PAD], 2)]
    for envs in kinds:
        envs.reset(seed=2)
    is_over = False
    for k in range(400):
        action = np.tile(np.array([1.0, 0.0, 0.6 if k < 9 else -0.6 if k < 18 else 0.0], np.float32), (2, 1))
        (seen, _, ended, _, infos), (expected, _, expected_end, _, expected_infos) = (
            envs.step(action) for envs in kinds
        )
        assert np.array_equal(seen, expected)
        assert np.array_equal(ended, expected_end)
        if ended.any():
            assert same_infos(infos, expected_infos)
            is_over = is_over or "out_of_bounds" in infos["outcome"].tolist()
    assert is_over


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"num_envs": 0}, "num_envs=0"),
        ({"autoreset_mode": "Disabled"}, "autoreset_mode='Disabled'"),
        ({"engine": "mujoco"}, "one lander at a time"),
    ],
)
def test_invalid_vector_arguments_raise(kwargs: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        gymnasium.make_vec(PAD, vectorization_mode="vector_entry_point", **kwargs)


@pytest.mark.parametrize(
    ("name", "actions"),
    [
        (VERTICAL, np.array([0, 4])),
        (VERTICAL, np.array([0, -1])),
        (VERTICAL, np.array([0])),
        (VERTICAL, np.array([0.0, 1.0])),
        (CONTINUOUS[PAD], np.array([[0.0, 0.0, 0.0], [0.0, np.nan, 0.0]])),
        (CONTINUOUS[PAD], np.array([[0.0, 0.0, 0.0], [1.5, 0.0, 0.0]])),
        (CONTINUOUS[PAD], np.zeros(2)),
    ],
)
def test_invalid_actions_raise_and_change_nothing(name: str, actions: Any) -> None:
    envs, other = vector(name, 2), vector(name, 2)
    envs.reset(seed=1)
    other.reset(seed=1)
    with pytest.raises(ParameterError, match="are not in"):
        envs.step(actions)
    good = envs.action_space.sample()
    assert np.array_equal(envs.step(good)[0], other.step(good)[0])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"options": {"start": [1]}}, "1 starts for 2"),
        ({"options": {"start": [1, 2.5]}}, "the start 2.5"),
        ({"options": {"begin": 1}}, "the options"),
        ({"options": {"dispersion": {"thrust_n": 0.6}}}, "a number from 0 to 0.5|'thrust_n': 0.6"),
        ({"seed": [1, 2, 3]}, "3 seeds for 2"),
    ],
)
def test_invalid_reset_raises(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        vector(VERTICAL, 2).reset(**given)


def test_step_before_reset_raises() -> None:
    with pytest.raises(ParameterError, match=r"call reset\(\)"):
        vector(VERTICAL, 2).step(np.array([0, 0]))


@pytest.mark.parametrize("starts", [7, [7, 7], np.array([7, 7])])
def test_starts_equal_those_of_scenario(starts: int | Sequence[int]) -> None:
    seen, infos = vector(PAD, 2).reset(options={"start": starts})
    expected, _ = gymnasium.make(PAD).reset(options={"start": 7})
    assert infos["start"].tolist() == [7, 7]
    assert np.array_equal(seen, [expected, expected])
