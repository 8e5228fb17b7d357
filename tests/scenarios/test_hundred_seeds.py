"""Each controller does what it is for, over a hundred starts, flown by the node with noisy sensors."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from snr_sim.scenario.flight import Flight
from snr_sim.scenario.simulation import Request, prepare

SEEDS = range(100)


def fly(scenario: str, controller: str, seed: int, engine: str = "") -> dict[str, Any]:
    """Run one start without recording."""
    simulation = prepare(Request(scenario, seed=seed, controller=controller, engine=engine or None))
    plant = simulation.plant()
    result = Flight(simulation, plant, simulation.config(plant)).run()
    assert not result.error
    return {"outcome": result.outcome, "success": result.success, **result.metrics}


@cache
def outcomes(scenario: str, controller: str, engine: str = "") -> list[dict[str, Any]]:
    """Run all starts, once for all tests that look at them."""
    return [fly(scenario, controller, seed, engine) for seed in SEEDS]


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
    assert fly(scenario, controller, seed=1)["success"]


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "controller", "least"), LANDINGS)
def test_so_many_of_a_hundred_seeds_land(scenario: str, controller: str, least: int) -> None:
    landed = [result["success"] for result in outcomes(scenario, controller)]
    assert sum(landed) >= least


@pytest.mark.slow
def test_the_same_controller_lands_the_same_starts_under_mujoco() -> None:
    plane, space = outcomes("lander_pad", "pad"), outcomes("lander_pad", "pad", "mujoco")
    assert sum(result["success"] for result in space) >= 98
    # In flight the two differ by less than the noise of a sensor, so both land every start at the same speed.
    for one, other in zip(plane, space, strict=True):
        assert other["touchdown"]["vertical_mps"] == pytest.approx(one["touchdown"]["vertical_mps"], abs=0.05)
        assert other["fuel_kg"] == pytest.approx(one["fuel_kg"], abs=2.0)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["lander_vertical", "lander_low_gate", "lander_pad", "lander_rough"])
def test_coasting_never_lands(scenario: str) -> None:
    assert {result["outcome"] for result in outcomes(scenario, "coast")} == {"crashed"}


@pytest.mark.slow
def test_the_optimal_controller_needs_within_two_percent_of_the_optimum_to_rest_on_average() -> None:
    flown = outcomes("lander_vertical", "optimal")
    ratios = [result["fuel_kg"] / result["fuel_optimum_to_rest_kg"] for result in flown]
    assert min(result["fuel_ratio"] for result in flown) > 1.0
    assert abs(ratios[0] - 1.0) < 0.02  # seed 0, the published case
    assert abs(sum(ratios) / len(ratios) - 1.0) < 0.02


@pytest.mark.slow
def test_hover_and_drop_wastes_fuel_that_the_optimal_controller_saves() -> None:
    ratios = [result["fuel_ratio"] for result in outcomes("lander_vertical", "hover_and_drop")]
    assert min(ratios) > 1.2


@pytest.mark.slow
def test_every_seed_is_another_start() -> None:
    for scenario in ("lander_vertical", "lander_low_gate", "lander_pad", "lander_rough"):
        optima = {result["fuel_optimum_kg"] for result in outcomes(scenario, "coast")}
        assert len(optima) == len(SEEDS)
