"""The lab "depth hold": the reference gets all points, each mistake costs its own, limits are far from the spread."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from statistics import fmean, pstdev
from typing import Any

import pytest

from snr_sim.scenario.flight import Flight
from snr_sim.scenario.simulation import Request, prepare
from tests.assignments.depth_hold.mistakes import MISTAKES

LAB = "02_depth_hold"
FOLDER = Path(__file__).parents[2] / "assignments" / LAB
REFERENCE = Path(__file__).parent / "depth_hold" / "reference"

# What was measured with the reference over 60 seeds: mean, standard deviation, and the limit of `urov_tank`.
SPREAD = {"settling_s": (2.72, 0.48, 6.5), "overshoot": (0.046, 0.024, 0.20), "steady_error_m": (0.022, 0.008, 0.10)}


def test_the_reference_gets_all_points(mark: Callable[..., Any]) -> None:
    result = mark(LAB, is_hidden=True, flown="holds")
    assert result.lost == {}, result.told


@pytest.mark.parametrize("name", MISTAKES)
def test_each_mistake_loses_its_own_points_and_is_named(name: str, mark: Callable[..., Any]) -> None:
    result = mark(LAB, name, is_hidden=True, flown="holds")
    assert result.lost == pytest.approx(MISTAKES[name].lost, abs=0.001), result.told
    assert MISTAKES[name].hint in result.told


def test_the_starter_runs_and_is_told_where_to_begin(mark: Callable[..., Any]) -> None:
    assert "Your work begins in up_force_n" in mark(LAB, starter=True).told


def dive(file: Path, seed: int) -> dict[str, Any]:
    """The metrics of one dive."""
    simulation = prepare(Request("urov_tank", seed=seed, controller=str(file)))
    plant = simulation.plant()
    result = Flight(simulation, plant, simulation.config(plant)).run()
    assert not result.error
    return result.metrics


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, pytest.param(60, marks=pytest.mark.nightly)])
def test_each_limit_is_five_standard_deviations_from_what_the_reference_does(count: int, tmp_path: Path) -> None:
    shutil.copytree(FOLDER / "starter", tmp_path, dirs_exist_ok=True)
    shutil.copytree(REFERENCE, tmp_path, dirs_exist_ok=True)
    found = [dive(tmp_path / "depth_hold.py", seed) for seed in range(1, count + 1)]
    for name, (mean, sd, limit) in SPREAD.items():
        values = [one[name] for one in found]
        assert limit > mean + 5.0 * sd
        assert all(abs(value - mean) < 4.0 * sd for value in values), name
        if count >= 50:
            assert limit > fmean(values) + 5.0 * pstdev(values), name


def test_the_picture_and_the_files_that_the_page_names_are_there() -> None:
    text = (FOLDER / "README.md").read_text()
    for name in re.findall(r"\]\((pictures/[^)]*)\)", text):
        assert (FOLDER / name).is_file(), name


def test_what_needs_no_change_is_the_same_as_in_the_lab_that_goes_on_from_here() -> None:
    other = FOLDER.parent / "08_sim_to_pi" / "starter" / "telling.py"
    assert (FOLDER / "starter" / "telling.py").read_bytes() == other.read_bytes()
