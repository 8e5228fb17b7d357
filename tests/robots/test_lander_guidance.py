"""The laws of the lander's controllers, run on plants through simulated devices, without a node."""

import importlib.util
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from snr_sim.plants.lander.descent import Motion, minimum_fuel_descent
from snr_sim.prelude.scenario import RobotContext, RobotInfo
from snr_sim.prelude.signals import EngineCommand
from tests.lanes import slow

ROOT = Path(__file__).parents[2]
ROBOT = ROOT / "robots" / "lander"
LAWS = {
    "hover_and_drop": "HoverAndDropLaw",
    "quadratic": "QuadraticLaw",
    "optimal": "OptimalLaw",
    "pad": "PadLaw",
}


def load(name: str, path: Path, folder: Path | None = None) -> ModuleType:
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path, submodule_search_locations=folder and [str(folder)])
        assert spec is not None
        assert spec.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


robot = load("snr_sim_robot_lander", ROBOT / "robot.py", ROBOT)


class Coasting:
    """What the controller `coast` does, as a law."""

    def __init__(self, parameters: Any) -> None: ...

    def update(self, *readings: Any) -> EngineCommand:
        return EngineCommand()


def law_of(controller: str) -> Any:
    if controller == "coast":
        return Coasting
    module = load(f"lander_controller_{controller}", ROBOT / "controllers" / f"{controller}.py")
    return getattr(module, LAWS[controller])


def simulate(scenario_name: str, seed: int, controller: str) -> dict[str, Any]:
    """Flies one run as the node does: sensors, law, engine, plant, at the robot's rate."""
    scenario = load(f"scenario_{scenario_name}", ROOT / "scenarios" / f"{scenario_name}.py")
    parameters, plant = scenario.parameters(seed), scenario.plant(seed, scenario.ENGINES[0])
    context = RobotContext(
        RobotInfo("lander", "lander", scenario_name, plant.engine, parameters, {}), "sim", seed, plant
    )
    names = ["radar", "inertial"] if parameters.inertial else ["radar"]
    sensors = [robot.sim_sensor(context, name) for name in names]
    engine, law, rate_hz = robot.sim_engine(context), law_of(controller)(parameters), parameters.radar.rate_hz
    tick = 0
    while scenario.verdict(plant) is None and tick / rate_hz < scenario.TIME_LIMIT_S:
        engine.write(law.update(*(sensor.read() for sensor in sensors), tick / rate_hz))
        tick += 1
        if plant.step_s is None:
            plant.step(tick / rate_hz - plant.time_s)
        else:
            for _ in range(round(1.0 / rate_hz / plant.step_s)):
                plant.step(plant.step_s)
    verdict = scenario.verdict(plant)
    return {**scenario.metrics(plant, seed), "outcome": verdict.outcome if verdict else "timeout"}


def to_rest(result: dict[str, Any]) -> float:
    """The propellant of a flight relative to that of the best one that comes to rest at the ground."""
    return float(result["fuel_kg"] / result["fuel_optimum_to_rest_kg"])


def outcomes(scenario: str, controller: str, seeds: range) -> Counter[str]:
    return Counter(simulate(scenario, seed, controller)["outcome"] for seed in seeds)


@pytest.mark.parametrize("scenario", ["lander_vertical", "lander_low_gate", "lander_pad", "lander_rough"])
def test_coasting_crashes(scenario: str) -> None:
    assert outcomes(scenario, "coast", range(3)) == {"crashed": 3}


@pytest.mark.parametrize("scenario", ["lander_vertical", "lander_low_gate"])
@pytest.mark.parametrize("controller", ["hover_and_drop", "quadratic", "optimal"])
def test_vertical_controllers_land_from_every_seed(scenario: str, controller: str) -> None:
    assert outcomes(scenario, controller, range(30)) == {"landed": 30}


@pytest.mark.parametrize("scenario", ["lander_rough", slow("lander_pad")])
def test_pad_controller_lands_from_every_seed(scenario: str) -> None:
    assert outcomes(scenario, "pad", range(20)) == {"landed": 20}


@pytest.mark.parametrize("scenario", ["lander_vertical", "lander_low_gate"])
def test_noisy_optimal_stays_within_2_percent_of_optimum_to_rest(scenario: str) -> None:
    assert to_rest(simulate(scenario, 0, "optimal")) == pytest.approx(1.0, abs=0.02)
    assert max(to_rest(simulate(scenario, seed, "optimal")) for seed in range(1, 30)) < 1.02


@pytest.mark.parametrize("scenario", ["lander_vertical", "lander_low_gate"])
def test_fuel_of_landings_is_never_below_optimum(scenario: str) -> None:
    """A perfect burn with a touchdown at the gear's limit needs just that; one to rest needs more."""
    module = load(f"scenario_{scenario}", ROOT / "scenarios" / f"{scenario}.py")
    for seed in range(5):
        begin, engine = module.start(seed), module.parameters(seed).engine
        start = Motion(begin.height_m, begin.velocity_mps, begin.mass_kg)
        ratios = []
        for final_mps in (3.0499, 2.0, 0.0):
            plant, best = (
                module.plant(seed, "closed_form"),
                minimum_fuel_descent(start, engine, touchdown_mps=final_mps),
            )
            plant.step(best.coast_s)
            plant.write("engine", EngineCommand(1.0))
            plant.step(best.burn_s - 1e-6)
            plant.write("engine", EngineCommand(0.0))
            plant.step(1.0)
            assert plant.outcome == "landed"
            ratios.append(module.metrics(plant, seed)["fuel_ratio"])
        assert ratios[0] == pytest.approx(1.0, abs=1e-4)
        assert 1.0 <= ratios[0] < ratios[1] < ratios[2]


def test_hover_needs_twice_and_quadratic_a_third_more_fuel() -> None:
    assert to_rest(simulate("lander_vertical", 0, "hover_and_drop")) > 1.8
    assert 1.1 < to_rest(simulate("lander_vertical", 0, "quadratic")) < 1.5


def test_seed_0_equals_case_of_reference_table() -> None:
    high, low = simulate("lander_vertical", 0, "coast"), simulate("lander_low_gate", 0, "coast")
    assert high["fuel_optimum_to_rest_kg"] == pytest.approx(174.465, abs=0.001)
    assert low["fuel_optimum_to_rest_kg"] == pytest.approx(64.702, abs=0.001)
    assert high["fuel_optimum_kg"] == pytest.approx(163.660, abs=0.001)
    assert low["fuel_optimum_kg"] == pytest.approx(54.756, abs=0.001)


@pytest.mark.parametrize("scenario", ["lander_vertical", "lander_low_gate", "lander_pad", "lander_rough"])
def test_start_differs_per_seed_and_is_reproducible(scenario: str) -> None:
    module = load(f"scenario_{scenario}", ROOT / "scenarios" / f"{scenario}.py")
    starts = [str(module.start(seed)) for seed in range(50)]
    assert len(set(starts)) == 50
    if hasattr(module.start, "cache_clear"):
        module.start.cache_clear()
    assert str(module.start(49)) == starts[49]


@pytest.mark.parametrize("scenario", ["lander_vertical", "lander_pad"])
def test_repeated_run_equals_first(scenario: str) -> None:
    controller = "pad" if scenario == "lander_pad" else "optimal"
    assert simulate(scenario, 7, controller) == simulate(scenario, 7, controller)
