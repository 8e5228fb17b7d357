"""Each dive of the underwater vehicle meets its criterion, from each seed, run by both nodes with noisy sensors.

A dive takes a second or two. So one seed of each scenario is tried in the fast lane, by test_urov.py, two in the slow
one, by test_digests.py, and all fifty in nightly.
"""

from __future__ import annotations

from typing import Any

import pytest

from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

SEEDS = 50
SCENARIOS = [found.name for found in library.list_available("scenarios") if library.robot_of_scenario(found) == "urov"]


def dive(scenario: str, seed: int) -> dict[str, Any]:
    """Dive once without recording."""
    simulation = prepare(Request(scenario, seed=seed))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    return {"seed": seed, "success": result.success, "why": [result.error, *result.notes], **result.metrics}


def test_eleven_dives_exist() -> None:
    names = "bad_link depth_hold gate heading_hold leak link_loss station_keeping sticks tank teleop thruster_failure"
    assert {f"urov_{name}" for name in names.split()} == set(SCENARIOS)


@pytest.mark.nightly
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_criterion_is_met_from_every_seed(scenario: str) -> None:
    results = [dive(scenario, seed) for seed in range(SEEDS)]
    assert [(result["seed"], result["why"]) for result in results if not result["success"]] == []
    assert all(result["energy_j"] > 0.0 for result in results)
    # A pilot without an autopilot, behind a constant delay: only the sensors differ, and nothing uses them.
    by_chance = [result["energy_j"] for result in results if result.get("fault") != "late"]
    assert len({*by_chance}) == len(by_chance) >= 0.8 * SEEDS - 1, "every seed is another dive"
