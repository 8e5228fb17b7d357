"""Each controller does what it is for, over a hundred starts, flown by the node with noisy sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from typing import Any

import pytest

SEEDS = range(100)


def fly(job: tuple[str, str, str, int]) -> dict[str, Any]:
    """Runs one start without recording; in a process of its own, so everything is named, nothing passed."""
    from snr_sim.flight import Flight
    from snr_sim.simulation import Request, prepare

    scenario, controller, engine, seed = job
    simulation = prepare(Request(scenario, seed=seed, controller=controller, engine=engine or None))
    plant = simulation.plant()
    result = Flight(simulation, plant, simulation.config(plant)).run()
    assert not result.error
    return {"outcome": result.outcome, "success": result.success, **result.metrics}


Outcomes = Callable[..., list[dict[str, Any]]]


@pytest.fixture(scope="module")
def outcomes() -> Iterator[Outcomes]:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:

        @cache
        def fly_all(scenario: str, controller: str, engine: str = "") -> list[dict[str, Any]]:
            return list(executor.map(fly, [(scenario, controller, engine, seed) for seed in SEEDS], chunksize=4))

        yield fly_all


@pytest.mark.parametrize(
    ("scenario", "controller", "least"),
    [
        ("lander_pad", "pad", 98),
        ("lander_rough", "pad", 90),
        ("lander_vertical", "optimal", 98),
        ("lander_vertical", "quadratic", 98),
        ("lander_vertical", "hover_and_drop", 98),
        ("lander_low_gate", "optimal", 98),
        ("lander_noisy", "hover_and_drop", 98),
    ],
)
def test_so_many_of_a_hundred_seeds_land(outcomes: Outcomes, scenario: str, controller: str, least: int) -> None:
    landed = [result["success"] for result in outcomes(scenario, controller)]
    assert sum(landed) >= least


def test_the_same_controller_lands_the_same_starts_under_mujoco(outcomes: Outcomes) -> None:
    plane, space = (outcomes("lander_pad", "pad", engine) for engine in ("", "mujoco"))
    assert sum(result["success"] for result in space) >= 98
    # In flight the two differ by less than the noise of a sensor, so both land every start at the same speed.
    for one, other in zip(plane, space, strict=True):
        assert other["touchdown"]["vertical_mps"] == pytest.approx(one["touchdown"]["vertical_mps"], abs=0.05)
        assert other["fuel_kg"] == pytest.approx(one["fuel_kg"], abs=2.0)


@pytest.mark.parametrize("scenario", ["lander_vertical", "lander_low_gate", "lander_pad", "lander_rough"])
def test_coasting_never_lands(outcomes: Outcomes, scenario: str) -> None:
    assert {result["outcome"] for result in outcomes(scenario, "coast")} == {"crashed"}


def test_the_optimal_controller_needs_within_two_percent_of_the_optimum_fuel_on_average(outcomes: Outcomes) -> None:
    ratios = [result["fuel_ratio"] for result in outcomes("lander_vertical", "optimal")]
    assert abs(ratios[0] - 1.0) < 0.02  # seed 0, the published case
    assert abs(sum(ratios) / len(ratios) - 1.0) < 0.02


def test_hover_and_drop_wastes_fuel_that_the_optimal_controller_saves(outcomes: Outcomes) -> None:
    ratios = [result["fuel_ratio"] for result in outcomes("lander_vertical", "hover_and_drop")]
    assert min(ratios) > 1.2


def test_every_seed_is_another_start(outcomes: Outcomes) -> None:
    for scenario in ("lander_vertical", "lander_low_gate", "lander_pad", "lander_rough"):
        optima = {result["fuel_optimum_kg"] for result in outcomes(scenario, "coast")}
        assert len(optima) == len(SEEDS)
