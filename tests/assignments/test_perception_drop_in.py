"""The lab "perception drop-in": its page, its reference with all points, and wrong ones, each with its own loss."""

import math
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim.grading.lab.lab import find_lab
from snr_sim.scenario import library
from snr_sim.scenario.library import load_controller
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.perception_drop_in.mistakes import MISTAKES

LAB = "06_perception_drop_in"
FOLDER = Path(__file__).parents[2] / "assignments" / LAB
HERE = Path(__file__).parent / "perception_drop_in"
KINDS = ("clear", "murky", "covered", "cluttered", "lost", "lost among clutter")


@pytest.mark.unmeasured
@pytest.mark.nightly  # those of lab 1 and 11 are tried before each landing
def test_commands_of_page_have_documented_results(type_page: Callable[..., dict[str, str]]) -> None:
    def solve(folder: Path) -> None:
        shutil.copy(HERE / "reference" / "perception.py", folder / "see_lab")

    printed = type_page(FOLDER / "README.md", {"look.py": solve})
    assert "what the camera saw at 3.0 s" in next(output for command, output in printed.items() if "look.py" in command)
    assert "camera" not in next(output for command, output in printed.items() if command.startswith("snr check"))


@pytest.mark.unmeasured
def test_reference_gets_all_points_on_hidden_cases(mark: Callable[..., Any]) -> None:
    assert mark(LAB, is_hidden=True, single_hidden=["hovers"]) == ({}, "")


@pytest.mark.nightly
def test_reference_gets_all_points_on_all_cases(mark: Callable[..., Any]) -> None:
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [100, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(101, 150))])
def test_reference_has_margin_in_simulation(seed: int) -> None:
    controller = str(HERE / "reference" / "perception.py")
    simulation = prepare(Request(str(FOLDER / "hover.py"), seed=seed, controller=controller))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert result.metrics["near_share"] > 0.95  # 0.8 is asked for


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, pytest.param(50, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("kind", KINDS)
def test_reference_has_margin_in_pictures(kind: str, count: int) -> None:
    library.load_robot(library.find("robots", "urov"))
    find_plate = load_controller(library.find("robots", "urov"), str(HERE / "reference" / "perception.py")).find_plate
    checks = sys.modules[find_lab(LAB).checks[0].function.__module__]
    for seed in range(500, 500 + count):
        for shot in checks.shots(checks.Scene(kind, seed)):
            found = find_plate(shot.rgb)
            assert (found is None) == (shot.off_px is None)
            assert found is None or math.dist(found, shot.off_px) < 3.0  # 5 are asked for, in 80 % of the pictures


@pytest.mark.parametrize("name", MISTAKES)
def test_wrong_solution_loses_listed_points(mark: Callable[..., Any], name: str) -> None:
    found = mark(LAB, name)
    assert found.lost == MISTAKES[name].lost
    assert MISTAKES[name].hint in found.feedback


def test_starter_fails_with_hints(mark: Callable[..., Any]) -> None:
    found = mark(LAB, starter=True)
    assert sum(found.lost.values()) == 80.0
    assert "water absorbs red first" in found.feedback
