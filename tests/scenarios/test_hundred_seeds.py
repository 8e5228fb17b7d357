"""Each controller meets its criterion from a hundred starts, run by the node with noisy sensors."""

from __future__ import annotations

from typing import Any

import pytest

from snr_sim.scenario.simulation import Request, Simulation, prepare
from snr_sim.scenario.simulation_run import SimulationRun

SEEDS = range(100)


def simulate(prepared: Simulation, seed: int) -> dict[str, Any]:
    """Run one start without recording."""
    simulation = prepared.with_seed(seed)
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert not result.error
    return {"outcome": result.outcome, "success": result.success, **result.metrics}


def outcomes(scenario: str, controller: str, engine: str = "") -> list[dict[str, Any]]:
    """Run all starts. Tests run in several processes, so one test has everything that looks at the same runs."""
    prepared = prepare(Request(scenario, controller=controller, engine=engine or None))
    return [simulate(prepared, seed) for seed in SEEDS]


LANDINGS = [
    ("lander_pad", "pad", 98),
    ("lander_rough", "pad", 90),
    ("lander_vertical", "optimal", 98),
    ("lander_vertical", "quadratic", 98),
    ("lander_vertical", "hover_and_drop", 98),
    ("lander_low_gate", "optimal", 98),
    ("lander_noisy", "hover_and_drop", 98),
]


@pytest.mark.parametrize(("scenario", "controller"), [landing[:2] for landing in LANDINGS])
def test_one_seed_lands(scenario: str, controller: str) -> None:
    assert simulate(prepare(Request(scenario, controller=controller)), seed=1)["success"]


def assert_fuel_is_near_optimum(runs: list[dict[str, Any]]) -> None:
    ratios = [result["fuel_kg"] / result["fuel_optimum_to_rest_kg"] for result in runs]
    assert min(result["fuel_ratio"] for result in runs) > 1.0
    assert abs(ratios[0] - 1.0) < 0.02  # seed 0, the published case
    assert abs(sum(ratios) / len(ratios) - 1.0) < 0.02


def assert_fuel_is_far_from_optimum(runs: list[dict[str, Any]]) -> None:
    assert min(result["fuel_ratio"] for result in runs) > 1.2


MORE = {
    ("lander_vertical", "optimal"): assert_fuel_is_near_optimum,
    ("lander_vertical", "hover_and_drop"): assert_fuel_is_far_from_optimum,
}


@pytest.mark.slow
@pytest.mark.unmeasured
@pytest.mark.parametrize(("scenario", "controller", "min_landed"), LANDINGS)
def test_minimum_number_of_100_seeds_lands_and_fuel_is_as_expected(
    scenario: str, controller: str, min_landed: int
) -> None:
    runs = outcomes(scenario, controller)
    assert sum(result["success"] for result in runs) >= min_landed
    if more := MORE.get((scenario, controller)):
        more(runs)


@pytest.mark.nightly
def test_mujoco_lands_same_starts() -> None:
    plane, space = (outcomes("lander_pad", "pad", engine) for engine in ("pymunk", "mujoco"))
    assert sum(result["success"] for result in space) >= 98
    # In flight the two differ by less than the noise of a sensor, so both land every start at the same speed.
    for one, other in zip(plane, space, strict=True):
        assert other["touchdown"]["vertical_mps"] == pytest.approx(one["touchdown"]["vertical_mps"], abs=0.05)
        assert other["fuel_kg"] == pytest.approx(one["fuel_kg"], abs=2.0)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["lander_vertical", "lander_low_gate", "lander_pad", "lander_rough"])
def test_coasting_never_lands_and_start_differs_per_seed(scenario: str) -> None:
    runs = outcomes(scenario, "coast")
    assert {result["outcome"] for result in runs} == {"crashed"}
    assert len({result["fuel_optimum_kg"] for result in runs}) == len(SEEDS)
