"""Physical parameters that differ by episode: drawn or given, reported, and used in the plant's own equations."""

import copy
from typing import Any

import gymnasium
import numpy as np
import pytest

import snr_sim.learning  # noqa: F401 - makes the names known
from snr_sim.learning.dispersion import factors_of
from snr_sim.plants.lander.descent import Engine, Motion, propagate
from snr_sim.prelude.errors import ParameterError, UnknownNameError
from snr_sim.prelude.signals import EngineCommand

every_scenario = pytest.mark.parametrize("name", ["LanderVertical", "LanderPad", "UrovDepthHold", "UrovStation"])


def made(name: str, **kwargs: Any) -> Any:
    return gymnasium.make(f"snr_sim/{name}-v0", **kwargs).unwrapped


def run_episode(env: Any, options: dict[str, Any], steps: int = 25) -> tuple[list[Any], dict[str, Any]]:
    observation, info = env.reset(seed=4, options=options)
    env.action_space.seed(1)
    return [observation.tolist(), *(env.step(env.action_space.sample())[0].tolist() for _ in range(steps))], info


@every_scenario
def test_reported_factors_repeat_dispersed_episode(name: str) -> None:
    env = made(name)
    spread = dict.fromkeys(env.plant.SCALABLE, 0.1)
    seen, info = run_episode(env, {"start": 2, "dispersion": spread})
    assert set(info["factors"]) == set(spread)
    assert all(0.9 <= factor <= 1.1 for factor in info["factors"].values())
    assert len(set(info["factors"].values())) == len(spread)
    nominal, without = run_episode(env, {"start": 2})
    assert "factors" not in without
    assert nominal != seen
    assert run_episode(env, {"start": 2, "factors": info["factors"]})[0] == seen
    assert run_episode(env, {"start": 2, "factors": dict.fromkeys(spread, 1.0)})[0] == nominal


@every_scenario
def test_every_scalable_number_has_an_effect(name: str) -> None:
    """Legs matter once they stand, and a gimbal's rate once the nozzle turns."""
    env = made(name)
    nominal = [np.array(one) for one in run_episode(env, {"start": 2})[0]]
    unseen = {"spring_npm", "damper_nspm", "friction", "gimbal_rate_radps"}
    for number in set(env.plant.SCALABLE) - unseen:
        seen, _ = run_episode(env, {"start": 2, "factors": {number: 1.2}})
        assert max(float(np.abs(a - b).max()) for a, b in zip(nominal, seen, strict=True)) > 0.001, number


def test_legs_of_a_scaled_module_are_scaled() -> None:
    env = made("LanderPad")
    leg = env.plant.module.leg
    env.reset(options={"factors": {"spring_npm": 0.5, "friction": 2.0, "gimbal_rate_radps": 1.5}})
    module = env.plant.module
    assert (module.leg.spring_npm, module.leg.friction) == (0.5 * leg.spring_npm, 2.0 * leg.friction)
    assert module.leg.damper_nspm == leg.damper_nspm


def test_scaled_module_equals_closed_form() -> None:
    env = made("LanderVertical")
    env.reset(options={"start": 0})
    plant = env.plant
    fuel_kg, dry_kg = plant.fuel_kg, plant.mass_kg - plant.fuel_kg
    engine = Engine(0.9 * plant.thrust_n, 1.1 * plant.exhaust_mps, 1.05 * plant.gravity_mps2)
    factors = {"thrust_n": 0.9, "exhaust_mps": 1.1, "gravity_mps2": 1.05, "dry_mass_kg": 1.2}
    env.reset(options={"start": 0, "factors": factors})
    plant = env.plant
    begin = Motion(plant.height_m, plant.velocity_mps, plant.mass_kg)
    assert (plant.fuel_kg, plant.mass_kg) == (fuel_kg, pytest.approx(fuel_kg + 1.2 * dry_kg))
    plant.write("engine", EngineCommand(1.0))
    plant.step(5.0)
    assert (plant.height_m, plant.velocity_mps, plant.mass_kg) == pytest.approx(propagate(begin, *engine, 5.0))


def test_next_episode_without_options_is_nominal() -> None:
    env = made("LanderPad")
    module = env.plant.module
    env.reset(options={"factors": {"thrust_n": 0.9}})
    assert env.plant.module.thrust_n == 0.9 * module.thrust_n
    env.reset()
    assert env.plant.module == module


def test_robot_parameters_stay_nominal() -> None:
    env = made("LanderPad")
    env.reset(options={"start": 1, "factors": {"thrust_n": 0.9, "dry_mass_kg": 1.1}})
    assert env.run.robot.parameters.module.thrust_n == pytest.approx(env.plant.module.thrust_n / 0.9)
    assert env.run.robot.parameters.mass_kg < env.plant.mass_kg


@pytest.mark.parametrize(("name", "engine"), [("LanderPad", "mujoco"), ("UrovDepthHold", "pymunk")])
def test_other_engine_accepts_same_names(name: str, engine: str) -> None:
    env = made(name, engine=engine)
    assert made(name).plant.SCALABLE == env.plant.SCALABLE
    env.reset(options={"dispersion": dict.fromkeys(env.plant.SCALABLE, 0.05)})
    env.step(env.action_space.sample())


def test_copy_of_dispersed_episode_keeps_its_physics() -> None:
    env = made("LanderPad")
    env.reset(seed=1, options={"dispersion": {"thrust_n": 0.2, "dry_mass_kg": 0.1}})
    env.step(7)
    twin = copy.deepcopy(env)
    assert np.array_equal(twin.step(7)[0], env.step(7)[0])
    assert twin.plant.module == env.plant.module


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"dispersion": {"thrust": 0.1}}, UnknownNameError, "no 'thrust' to scale"),
        ({"dispersion": 0.1}, ParameterError, "dispersion=0.1, which is not a dict"),
        ({"dispersion": {"thrust_n": 0.6}}, ParameterError, "'thrust_n': 0.6"),
        ({"dispersion": {"thrust_n": -0.1}}, ParameterError, "'thrust_n': -0.1"),
        ({"dispersion": {"thrust_n": True}}, ParameterError, "'thrust_n': True"),
        ({"dispersion": {"thrust_n": "5 %"}}, ParameterError, "'thrust_n': '5 %'"),
        ({"factors": {"thrust_n": float("nan")}}, ParameterError, "'thrust_n': nan"),
        ({"factors": {"thrust_n": 0.0}}, ParameterError, "'thrust_n': 0.0"),
        ({"factors": {3: 1.0}}, UnknownNameError, "no '3' to scale"),
        ({"factors": {"thrust_n": 1.1}, "dispersion": {"thrust_n": 0.1}}, ParameterError, "in factors and in disp"),
        ({"physics": {}}, ParameterError, r"options \['physics'\]"),
    ],
)
def test_invalid_options_raise(options: dict[str, Any], error: type[Exception], message: str) -> None:
    env = made("LanderVertical")
    with pytest.raises(error, match=message):
        env.reset(options=options)


def test_unknown_name_raises_with_nearest_name() -> None:
    with pytest.raises(UnknownNameError) as refused:
        factors_of({"factors": {"thrust": 1.0}}, ("thrust_n", "dry_mass_kg"), np.random.default_rng(0))
    assert "thrust_n" in refused.value.fix
