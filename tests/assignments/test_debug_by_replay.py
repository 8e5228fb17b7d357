"""The lab "debug by replay": its page, its reference with all points, and wrong ones, each with its own loss."""

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim.grading.lab.lab import find_lab
from snr_sim.scenario.simulation import Request, Simulation, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.debug_by_replay.mistakes import MISTAKES

LAB = "09_debug_by_replay"
PAGE = Path(__file__).parents[2] / "assignments" / LAB / "README.md"
HERE = Path(__file__).parent / "debug_by_replay"


@pytest.mark.nightly  # those of lab 1 and 11 are tried before each landing
def test_commands_of_page_have_documented_results(type_page: Callable[..., dict[str, str]]) -> None:
    def repair(folder: Path) -> None:
        shutil.copy(HERE / "reference" / "findings.toml", folder / "debug_lab")

    printed = type_page(PAGE, {"--name engine": repair})
    assert "crashed" in next(output for command, output in printed.items() if "failed.py" in command)
    assert "component estimator" in next(output for command, output in printed.items() if "only_1.py" in command)
    assert "landed" in next(output for command, output in printed.items() if "resim" in command)


def test_reference_gets_all_points_on_hidden_cases(mark: Callable[..., Any]) -> None:
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.slow
def test_reference_has_margin_on_50_seeds_and_mistakes_break_rules() -> None:
    checks = sys.modules[find_lab(LAB).checks[0].function.__module__]
    for repairs in ("1,2,3", "1,2", "1,3", "2,3"):
        request = Request(
            "lander_vertical", controller=str(HERE / "reference" / "repaired.py"), options={"repairs": repairs}
        )
        simulation = prepare(request)
        for seed in range(300, 350 if repairs == "1,2,3" else 310):
            speed_mps, low_mps = descent(simulation.with_seed(seed), checks.LOW_M)
            if repairs == "1,2,3":
                assert speed_mps < checks.SOFT_MPS - 0.25, seed
                assert low_mps < checks.LOW_MPS - 0.5, seed
            else:
                assert speed_mps > checks.SOFT_MPS + 0.2 or low_mps > checks.LOW_MPS + 0.5, (repairs, seed)


def descent(simulation: Simulation, low_m: float) -> tuple[float, float]:
    """How fast a module touched down, and how fast it was at most below a height."""
    plant: Any = simulation.plant()
    speeds = [0.0]

    def look(time_s: float) -> None:
        values = plant.truth()["values"]
        if values["altitude_m"] < low_m:
            speeds.append(-values["vertical_mps"])

    result = SimulationRun(simulation, plant, simulation.config(plant), on_advance=look).run()
    return abs(result.metrics["touchdown"]["vertical_mps"]), max(speeds)


@pytest.mark.parametrize("name", MISTAKES)
def test_wrong_solution_loses_listed_points(mark: Callable[..., Any], name: str) -> None:
    found = mark(LAB, name)
    assert found.lost == MISTAKES[name].lost
    assert MISTAKES[name].hint in found.feedback


def test_starter_fails_with_hints(mark: Callable[..., Any]) -> None:
    found = mark(LAB, starter=True)
    assert sum(found.lost.values()) == 95.0
    assert "Finding 1 has no repair yet" in found.feedback
    assert "the outcome was 'crashed', not 'landed'" in found.feedback
