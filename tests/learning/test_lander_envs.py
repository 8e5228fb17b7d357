"""The lander as a gymnasium environment: by the book, the same every time, and the same as in a node."""

import json
import math
import subprocess
import sys
import textwrap
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import snr_sim.learning
from snr_sim.learning.gym import ENVIRONMENTS
from snr_sim.learning.lander_envs import VERTICAL_THROTTLES, LanderPad, pad_observation, reference_speed_mps
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.signals import InertialReading, RadarReading
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

every_environment = pytest.mark.parametrize("name", list(ENVIRONMENTS))


@every_environment
def test_gymnasium_checker_passes(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(name, render_mode="rgb_array").unwrapped)


def episode(name: str, seed: int, max_steps: int = 10_000) -> list[Any]:
    """All observations of an episode with random actions."""
    env = gymnasium.make(name)
    env.action_space.seed(seed)
    observation, info = env.reset(seed=seed)
    seen: list[Any] = [observation.tolist(), info]
    for _ in range(max_steps):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        seen.append([observation.tolist(), reward, terminated, truncated, info])
        if terminated or truncated:
            break
    env.close()
    return seen


@pytest.mark.slow
@every_environment
def test_same_seed_gives_same_episode_in_another_process(name: str) -> None:
    mine = episode(name, 5, 60)
    assert episode(name, 5, 60) == mine
    assert episode(name, 6, 60) != mine
    code = (
        "import json, sys; sys.path.insert(0, sys.argv[1])\n"
        "from test_lander_envs import episode\n"
        f"print(json.dumps(episode({name!r}, 5, 60)))"
    )
    printed = subprocess.check_output([sys.executable, "-c", code, str(Path(__file__).parent)], text=True)
    assert json.loads(printed) == json.loads(json.dumps(mine))


@pytest.mark.parametrize("name", ["snr_sim/LanderVertical-v0", "snr_sim/LanderPad-v0"])
def test_episodes_without_seed_have_different_starts(name: str) -> None:
    env = gymnasium.make(name)
    env.reset(seed=3)
    starts = [env.reset()[1]["start"] for _ in range(5)]
    env.reset(seed=3)
    assert [env.reset()[1]["start"] for _ in range(5)] == starts
    assert len(set(starts)) == 5


def test_crash_terminates_and_time_limit_truncates() -> None:
    env: Any = gymnasium.make("snr_sim/LanderVertical-v0")
    env.reset(options={"start": 0})
    ended, steps = (False, False), 0
    while not any(ended):
        before = env.unwrapped.potential()
        _, reward, *ended, info = env.step(0)  # type: ignore[assignment]
        steps += 1
    assert ended == [True, False]
    assert (info["outcome"], info["success"]) == ("crashed", False)
    assert reward == pytest.approx(-100.0 - before)  # no propellant was burned
    assert info["time_s"] == steps / 5.0

    hovering = gymnasium.make("snr_sim/LanderVerticalContinuous-v0").unwrapped
    hovering.reset(options={"start": 0})
    ended = (False, False)
    while not any(ended):
        plant: Any = hovering.plant  # type: ignore[attr-defined]
        hover = plant.mass_kg * plant.gravity_mps2 / plant.thrust_n - 0.05 * plant.velocity_mps
        _, _, *ended, info = hovering.step(np.array([np.clip(hover, 0.0, 1.0)], np.float32))  # type: ignore[assignment]
    assert (info["outcome"], info["time_s"]) == ("timeout", 240.0)
    assert ended == [False, True]


def thrifty(altitude_m: float, velocity_mps: float) -> int:
    """A policy: full throttle while it falls faster than suits the height."""
    return VERTICAL_THROTTLES.index(1.0) if velocity_mps < reference_speed_mps(altitude_m) else 0


CONTROLLER = """
    from snr_sim import Endpoint, EndpointFactory, TaskType
    from snr_sim.learning.lander_envs import VERTICAL_THROTTLES, reference_speed_mps
    import numpy as np

    class ThriftyFactory(EndpointFactory):
        def get(self, parent):
            return Thrifty(self, parent, "thrifty")

    class Thrifty(Endpoint):
        def __init__(self, factory, parent, name):
            super().__init__(factory, parent, name)
            self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

        def on_radar(self, task, task_id):
            radar = self.get_data("radar")
            height, speed = np.float32(radar["altitude_m"]), np.float32(radar["velocity_mps"])
            throttle = 1.0 if speed < reference_speed_mps(float(height)) else 0.0
            return self.store_data_task("engine", {"throttle": throttle}, process=False)

    def factories(robot):
        return [ThriftyFactory()]
"""


@pytest.mark.parametrize("start", [0, 7])
def test_policy_in_node_lands_as_in_environment_bitwise(start: int, tmp_path: Path) -> None:
    env: Any = gymnasium.make("snr_sim/LanderVertical-v0").unwrapped
    observation, _ = env.reset(options={"start": start})
    ended = False
    while not ended:
        observation, _, ended, _, info = env.step(thrifty(*map(float, observation)))
    assert info["outcome"] == "landed"

    file = tmp_path / "thrifty.py"
    file.write_text(textwrap.dedent(CONTROLLER))
    simulation = prepare(Request("lander_vertical", seed=start, controller=str(file)))
    plant: Any = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert result.outcome == "landed"
    assert plant.touchdown == env.plant.touchdown
    assert plant.fuel_kg == env.plant.fuel_kg


def test_return_of_landing_equals_sum_of_parts() -> None:
    """Potentials telescope: what is left is the landing, the propellant, and where the episode began."""
    env: Any = gymnasium.make("snr_sim/LanderVertical-v0").unwrapped
    observation, _ = env.reset(options={"start": 7})
    began, tank_kg, total, ended = env.potential(), env.plant.fuel_kg, 0.0, False
    while not ended:
        observation, reward, ended, _, _ = env.step(thrifty(*map(float, observation)))
        total += reward
    assert total == pytest.approx(100.0 - 50.0 * (tank_kg - env.plant.fuel_kg) / tank_kg - began, abs=1e-6)


def test_step_outside_episode_raises() -> None:
    env: Any = gymnasium.make("snr_sim/LanderVertical-v0").unwrapped
    with pytest.raises(ParameterError, match=r"call reset\(\)"):
        env.step(0)
    env.reset(options={"start": 0})
    while not env.step(0)[2]:
        pass
    with pytest.raises(ParameterError, match="has ended"):
        env.step(0)


@pytest.mark.parametrize(
    ("name", "action"),
    [
        ("snr_sim/LanderVertical-v0", 4),
        ("snr_sim/LanderVertical-v0", 0.5),
        ("snr_sim/LanderVertical-v0", None),
        ("snr_sim/LanderPadContinuous-v0", np.array([0.5, 0.0], np.float32)),
        ("snr_sim/LanderPadContinuous-v0", np.array([np.nan, 0.0, 0.0], np.float32)),
        ("snr_sim/LanderPadContinuous-v0", "full"),
    ],
)
def test_invalid_action_raises_and_changes_nothing(name: str, action: Any) -> None:
    env: Any = gymnasium.make(name).unwrapped
    env.reset(seed=1)
    with pytest.raises(ParameterError, match="is not an action"):
        env.step(action)
    assert env.plant.time_s == 0.0


@pytest.mark.parametrize("throttle", [np.array([0.5]), np.array([1]), [0.5], (0,), np.array([0.5], np.float16)])
def test_action_of_other_dtype_within_bounds_is_accepted(throttle: Any) -> None:
    envs: list[Any] = [gymnasium.make("snr_sim/LanderVerticalContinuous-v0").unwrapped for _ in range(2)]
    for env, action in zip(envs, (throttle, np.array(throttle, np.float32)), strict=True):
        env.reset(options={"start": 7})
        env.step(action)
    assert envs[0].plant.snapshot() == envs[1].plant.snapshot()


@pytest.mark.parametrize(
    ("action", "kind"),
    [
        (np.array([1.0 + 1e-12]), r"float64 of shape \(1,\)"),  # would round to 1
        (np.array([[0.5]]), r"float64 of shape \(1, 1\)"),
        (np.array([True]), "bool of shape"),
        (0.5, r"float64 of shape \(\)"),
        ([[0.5], [0.5, 0.5]], "is not an action"),
    ],
)
def test_invalid_action_error_contains_type_and_example(action: Any, kind: str) -> None:
    env: Any = gymnasium.make("snr_sim/LanderVerticalContinuous-v0").unwrapped
    env.reset(seed=1)
    with pytest.raises(ParameterError, match=kind) as refused:
        env.step(action)
    assert "np.array([0.0], np.float32)" in refused.value.fix


def test_render_fps_equals_step_rate() -> None:
    rates = {"snr_sim/LanderVertical-v0": 5, "snr_sim/LanderPad-v0": 10, "snr_sim/UrovStation-v0": 10}
    assert {name: gymnasium.make(name).metadata["render_fps"] for name in rates} == rates


def test_attitude_observation_wraps() -> None:
    """A little past half a turn to one side is nearly half a turn to the other."""
    turned = [
        InertialReading([0.0, 9.0], [0.0, 0.0], angle, 0.0, 600.0, [False, False], 0.0)
        for angle in (3.0, math.pi + 0.1, -math.pi - 0.1, 2.0 * math.pi + 0.2)
    ]
    seen = [pad_observation(RadarReading(9.0, 0.0, 0.0), one)[4] for one in turned]
    assert seen == pytest.approx([3.0, 0.1 - math.pi, math.pi - 0.1, 0.2], abs=1e-6)


@pytest.mark.parametrize("options", [{"start": "7"}, {"start": True}, {"start": 1.5}, {"begin": 7}])
def test_invalid_options_raise(options: dict[str, Any]) -> None:
    env: Any = gymnasium.make("snr_sim/LanderVertical-v0").unwrapped
    with pytest.raises(ParameterError, match=r"reset\(\) was given"):
        env.reset(options=options)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["sync", "async"])
@pytest.mark.parametrize("name", ["LanderVertical", "LanderPad", "UrovStation", "LunarLanderBox"])
def test_parallel_environments_are_independent(name: str, mode: str) -> None:
    name = f"snr_sim/{name}-v0"
    envs = gymnasium.make_vec(name, num_envs=2, vectorization_mode=mode)
    alone = [gymnasium.make(name) for _ in range(2)]
    try:
        observations, _ = envs.reset(seed=11)  # of one 11, of the other 12
        assert np.array_equal(observations, [env.reset(seed=11 + i)[0] for i, env in enumerate(alone)])
        assert not np.array_equal(observations[0], observations[1])
        envs.action_space.seed(3)
        for _ in range(5):
            actions = envs.action_space.sample()
            observations, *_ = envs.step(actions)
            assert np.array_equal(observations, [env.step(actions[i])[0] for i, env in enumerate(alone)])
    finally:
        envs.close()


@pytest.mark.slow
def test_make_by_module_and_id_in_new_interpreter() -> None:
    code = 'import gymnasium; print(gymnasium.make("snr_sim.learning:snr_sim/LanderPad-v0").reset(seed=1)[0].shape)'
    assert subprocess.check_output([sys.executable, "-W", "error", "-c", code], text=True) == "(9,)\n"
    assert snr_sim.learning is sys.modules["snr_sim.learning"]


@pytest.mark.slow
def test_environments_are_registered_when_gymnasium_is_imported_later() -> None:
    code = (
        "import sys, snr_sim.learning; assert 'gymnasium' not in sys.modules\n"
        "import gymnasium; print(gymnasium.spec('snr_sim/LanderPad-v0').id)"
    )
    assert subprocess.check_output([sys.executable, "-W", "error", "-c", code], text=True) == "snr_sim/LanderPad-v0\n"


def test_frame_shows_module_and_thrust() -> None:
    env: Any = gymnasium.make("snr_sim/LanderPad-v0", render_mode="rgb_array")
    env.reset(seed=1)
    off = env.render()
    for _ in range(3):
        env.step(7)
    burning = env.render()
    assert off.shape == burning.shape == (240, 320, 3)
    orange = ((burning[..., 0] > 200) & (burning[..., 2] < 80)).sum()
    assert orange > ((off[..., 0] > 200) & (off[..., 2] < 80)).sum() + 20
    with pytest.raises(ParameterError, match="'rgb_array'"):
        LanderPad(render_mode="ansi")


@every_environment
def test_spec_has_time_limit_of_scenario(name: str) -> None:
    """`make` truncates at the step at which the environment itself does, and at no other."""
    env: Any = gymnasium.make(name)
    bare = env.unwrapped
    # A scenario that judges when its time is over does so a second before its own limit.
    spare_s = 1.0 if bare.ends_by_clock else 0.0
    assert env.spec.max_episode_steps == round((bare.limit_s - spare_s - bare.begins_s) * bare.rate_hz)
    assert env.spec.reward_threshold is not None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["snr_sim/UrovDepthHold-v0", "snr_sim/UrovStation-v0"])
def test_vehicle_spec_ends_with_verdict(name: str) -> None:
    env: Any = gymnasium.make(name).unwrapped
    env.reset(seed=1)
    steps = 1
    while not env.step(np.zeros(env.action_space.shape, np.float32))[3]:
        steps += 1
    assert steps == gymnasium.spec(name).max_episode_steps


@pytest.mark.parametrize("start", [0, 7])
def test_frame_from_high_altitude_shows_ground_to_both_edges(start: int) -> None:
    """What is drawn of the country is 500 m wide, and a picture from 1000 m up is wider."""
    env: Any = gymnasium.make("snr_sim/LanderVertical-v0", render_mode="rgb_array")
    env.reset(options={"start": start})
    picture = env.render()
    background, ground = picture[0, 0].tolist(), picture[-1]
    assert ground.tolist() == [ground[0].tolist()] * picture.shape[1]
    assert ground[0].tolist() != background
    assert (picture[: picture.shape[0] // 2, 0] == background).all()
