"""Each dive of the underwater vehicle meets its criterion, whatever the seed, flown by both nodes with noisy sensors.

A dive takes a second or two, so a test run takes a sample of the seeds, another one for each scenario. All fifty of all
scenarios, in about ten minutes: SNR_SEEDS=50 python -m pytest tests/scenarios/test_fifty_seeds.py
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import pytest

from snr_sim import library

SEEDS = 50
SAMPLE = min(SEEDS, int(os.environ.get("SNR_SEEDS", "2")))
SCENARIOS = [found.name for found in library.known("scenarios") if library.robot_of_scenario(found) == "urov"]


def dive(job: tuple[str, int]) -> dict[str, Any]:
    """Dives once without recording; in a process of its own, so everything is named, nothing passed."""
    from snr_sim.flight import Flight
    from snr_sim.simulation import Request, prepare

    scenario, seed = job
    simulation = prepare(Request(scenario, seed=seed))
    plant = simulation.plant()
    result = Flight(simulation, plant, simulation.config(plant)).run()
    return {"seed": seed, "success": result.success, "why": [result.error, *result.notes], **result.metrics}


@pytest.fixture(scope="module")
def executor() -> Iterator[ProcessPoolExecutor]:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        yield executor


def test_there_are_the_eleven_dives() -> None:
    names = "bad_link depth_hold gate heading_hold leak link_loss station_keeping sticks tank teleop thruster_failure"
    assert {f"urov_{name}" for name in names.split()} == set(SCENARIOS)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_criterion_is_met_from_every_seed(executor: ProcessPoolExecutor, scenario: str) -> None:
    first = 7 * SCENARIOS.index(scenario)
    jobs = [(scenario, (first + i) % SEEDS) for i in range(SAMPLE)]
    results = list(executor.map(dive, jobs))
    assert [(result["seed"], result["why"]) for result in results if not result["success"]] == []
    assert all(result["energy_j"] > 0.0 for result in results)
    assert len({result["energy_j"] for result in results}) == len(jobs), "every seed is another dive"
