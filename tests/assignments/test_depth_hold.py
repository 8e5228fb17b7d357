"""The lab "depth hold": the reference gets all points, each mistake costs its own, limits are far from the spread."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from statistics import fmean, pstdev
from typing import Any

import pytest

from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.depth_hold.mistakes import MISTAKES

LAB = "02_depth_hold"
FOLDER = Path(__file__).parents[2] / "assignments" / LAB
REFERENCE = Path(__file__).parent / "depth_hold" / "reference"

# What was measured with the reference over 60 seeds: mean, standard deviation, and the limit of `urov_tank`.
SPREAD = {"settling_s": (2.72, 0.48, 6.5), "overshoot": (0.046, 0.024, 0.20), "steady_error_m": (0.022, 0.008, 0.10)}


def test_reference_gets_all_points(mark: Callable[..., Any]) -> None:
    result = mark(LAB, is_hidden=True, single_hidden=["holds"])
    assert result.lost == {}, result.feedback


@pytest.mark.parametrize("name", MISTAKES)
def test_wrong_solution_loses_listed_points_and_gets_hint(name: str, mark: Callable[..., Any]) -> None:
    result = mark(LAB, name, is_hidden=True, single_hidden=["holds"])
    assert result.lost == pytest.approx(MISTAKES[name].lost, abs=0.001), result.feedback
    assert MISTAKES[name].hint in result.feedback


def test_starter_runs_and_gets_first_hint(mark: Callable[..., Any]) -> None:
    assert "Start with up_force_n" in mark(LAB, starter=True).feedback


def dive(file: Path, seed: int) -> dict[str, Any]:
    """The metrics of one dive."""
    simulation = prepare(Request("urov_tank", seed=seed, controller=str(file)))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert not result.error
    return result.metrics


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, pytest.param(60, marks=pytest.mark.nightly)])
def test_limits_are_5_sigma_from_reference(count: int, tmp_path: Path) -> None:
    shutil.copytree(FOLDER / "starter", tmp_path, dirs_exist_ok=True)
    shutil.copytree(REFERENCE, tmp_path, dirs_exist_ok=True)
    found = [dive(tmp_path / "depth_hold.py", seed) for seed in range(1, count + 1)]
    for name, (mean, sd, limit) in SPREAD.items():
        values = [one[name] for one in found]
        assert limit > mean + 5.0 * sd
        assert all(abs(value - mean) < 4.0 * sd for value in values), name
        if count >= 50:
            assert limit > fmean(values) + 5.0 * pstdev(values), name


def test_unchanged_files_equal_those_of_lab_8() -> None:
    other = FOLDER.parent / "08_sim_to_pi" / "starter" / "telling.py"
    assert (FOLDER / "starter" / "telling.py").read_bytes() == other.read_bytes()
