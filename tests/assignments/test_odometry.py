"""The lab "odometry": all points for the reference, its own for each mistake, the limit far from the spread."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from statistics import fmean, pstdev
from typing import Any

import pytest

from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.odometry.mistakes import MISTAKES
from tests.lanes import nightly

LAB = "14_odometry"
FLIGHT = "square"  # the check that takes long
BEFORE_THE_NIGHT = "not_wrapped"  # a mistake that loses it
FOLDER = Path(__file__).parents[2] / "assignments" / LAB
REFERENCE = Path(__file__).parent / "odometry" / "reference"

# How far from a corner it comes at most, measured with the reference over 20 seeds: mean, standard deviation, limit.
MEAN_M, SD_M, LIMIT_M = 0.20, 0.04, 0.5


def test_reference_gets_all_points(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out(FLIGHT)  # its visible case is one of test_references.py
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.nightly
def test_reference_gets_all_points_of_a_hidden_drive(mark: Callable[..., Any]) -> None:
    assert mark(LAB, is_hidden=True, single_hidden=[FLIGHT]) == ({}, "")


@pytest.mark.parametrize("name", MISTAKES)
def test_wrong_solution_loses_listed_points_and_gets_hint(name: str, mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out(FLIGHT)
    result = mark(LAB, name, is_hidden=True)
    lost = {check: points for check, points in MISTAKES[name].lost.items() if check != FLIGHT}
    assert result.lost == pytest.approx(lost, abs=0.001), result.feedback
    assert MISTAKES[name].hint in result.feedback


@pytest.mark.parametrize("name", [nightly(name) if name != BEFORE_THE_NIGHT else name for name in MISTAKES])
def test_wrong_solution_loses_listed_points_by_a_hidden_drive(name: str, mark: Callable[..., Any]) -> None:
    result = mark(LAB, name, is_hidden=True, single_hidden=[FLIGHT])
    assert result.lost == pytest.approx(MISTAKES[name].lost, abs=0.001), result.feedback


def test_starter_runs_and_gets_first_hint(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out(FLIGHT)
    assert "step 2 begins in way_m" in mark(LAB, starter=True).feedback


@pytest.mark.nightly  # those of lab 1 and 11 are tried before each landing
def test_commands_of_page_have_documented_results(type_page: Callable[..., dict[str, str]]) -> None:
    def solved(here: Path) -> None:
        shutil.copy(REFERENCE / "where.py", here / "odometry")

    type_page(FOLDER / "README.md", after={"first.png": solved})


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, pytest.param(20, marks=pytest.mark.nightly)])
def test_limit_is_5_sigma_from_reference(count: int, tmp_path: Path) -> None:
    shutil.copytree(FOLDER / "starter", tmp_path, dirs_exist_ok=True)
    shutil.copytree(REFERENCE, tmp_path, dirs_exist_ok=True)
    missed = []
    for seed in range(count):
        simulation = prepare(Request("rover_square", seed=seed, controller=str(tmp_path / "where.py")))
        plant = simulation.plant()
        missed.append(max(SimulationRun(simulation, plant, simulation.config(plant)).run().metrics["nearest_m"]))
    assert LIMIT_M > MEAN_M + 5.0 * SD_M
    assert all(abs(one - MEAN_M) < 4.0 * SD_M for one in missed)
    if count >= 20:
        assert fmean(missed) + 5.0 * pstdev(missed) < LIMIT_M
