"""The lab "moving average": all points for the reference, its own for each mistake, limits far from the spread."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import fmean, pstdev
from typing import Any

import pytest

from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.moving_average.mistakes import MISTAKES

LAB = "03_moving_average"
FOLDER = Path(__file__).parents[2] / "assignments" / LAB
REFERENCE = Path(__file__).parent / "moving_average" / "reference"

# The touchdown's speed, measured with the reference over 40 seeds: mean, standard deviation, and what the gear takes.
MEAN_MPS, SD_MPS, LIMIT_MPS = 1.70, 0.24, 3.05


def test_reference_gets_all_points(mark: Callable[..., Any]) -> None:
    result = mark(LAB, is_hidden=True, single_hidden=["lands"])
    assert result.lost == {}, result.feedback


@pytest.mark.parametrize("name", MISTAKES)
def test_wrong_solution_loses_listed_points_and_gets_hint(name: str, mark: Callable[..., Any]) -> None:
    result = mark(LAB, name, is_hidden=True, single_hidden=["lands"])
    assert result.lost == pytest.approx(MISTAKES[name].lost, abs=0.001), result.feedback
    assert MISTAKES[name].hint in result.feedback


def test_starter_runs_and_gets_first_hint(mark: Callable[..., Any]) -> None:
    assert "Step 2 begins in MovingAverage.update" in mark(LAB, starter=True).feedback


@pytest.mark.slow
def test_my_tests_accepts_correct_mean(tmp_path: Path) -> None:
    shutil.copytree(FOLDER / "starter", tmp_path, dirs_exist_ok=True)
    shutil.copytree(REFERENCE, tmp_path, dirs_exist_ok=True)
    mine = (FOLDER / "starter" / "my_tests.py").read_text()
    by_hand = '{"length": 2, "values": [0.1, 0.2], "means": [0.1, 0.15]}'  # and 0.15000000000000002 comes out
    (tmp_path / "my_tests.py").write_text(mine.replace("# Step 5", by_hand + ",  # Step 5"))
    done = subprocess.run([sys.executable, "my_tests.py"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert f"right for {by_hand}".replace('"', "'") in done.stdout
    assert "wrong" not in done.stdout


@pytest.mark.nightly  # those of lab 1 and 11 are tried before each landing
def test_commands_of_page_have_documented_results(type_page: Callable[..., dict[str, str]]) -> None:
    def solved(here: Path) -> None:
        shutil.copy(REFERENCE / "smooth.py", here / "moving_average")
        tests = here / "moving_average" / "my_tests.py"  # with what prints, which the reference is without
        begin, end = (REFERENCE / "my_tests.py").read_text(), tests.read_text().partition("\n\nif __name__")
        tests.write_text(f"{begin}{''.join(end[1:])}")

    printed = type_page(FOLDER / "README.md", after={"first.png": solved})
    assert "crashed" in next(output for command, output in printed.items() if "--out moving_average/first" in command)
    (tried,) = (output for command, output in printed.items() if "my_tests.py" in command)
    assert {line.partition(" ")[0] for line in tried.splitlines()} == {"right"}


def touchdown_mps(file: Path, seed: int) -> float:
    """The speed of one touchdown."""
    simulation = prepare(Request("lander_noisy", seed=seed, controller=str(file)))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert not result.error
    return float(result.metrics["touchdown"]["vertical_mps"])


@pytest.mark.slow
@pytest.mark.parametrize("count", [8, pytest.param(60, marks=pytest.mark.nightly)])
def test_limit_is_5_sigma_from_reference(count: int, tmp_path: Path) -> None:
    shutil.copytree(FOLDER / "starter", tmp_path, dirs_exist_ok=True)
    shutil.copytree(REFERENCE, tmp_path, dirs_exist_ok=True)
    speeds = [touchdown_mps(tmp_path / "smooth.py", seed) for seed in range(count)]
    assert LIMIT_MPS > MEAN_MPS + 5.0 * SD_MPS
    assert all(abs(speed - MEAN_MPS) < 4.0 * SD_MPS for speed in speeds)
    if count >= 50:
        assert fmean(speeds) + 5.0 * pstdev(speeds) < LIMIT_MPS
