"""The lab "mission state machine": its page, its reference with all points, and wrong ones, each with its own loss."""

import math
import re
import shutil
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from snr_sim.cli.main import app
from snr_sim.grading.lab.lab import Case, find_lab
from snr_sim.grading.lab.student import Student
from snr_sim.scenario.flight import Flight
from snr_sim.scenario.simulation import Request, prepare
from tests.assignments.mission_state_machine.mistakes import MISTAKES

LAB = "05_mission_state_machine"
FOLDER = Path(__file__).parents[2] / "assignments" / LAB
HERE = Path(__file__).parent / "mission_state_machine"
FLIGHTS = ("swims", "stops_in_the_water")
# Measured over 19 seeds from 100 on: 0.035 m off the middle, deviation 0.013, so 0.2 m is twelve deviations away.


def test_every_command_and_picture_that_the_page_names_is_there() -> None:
    verbs: dict[str, Any] = get_command(app).commands  # type: ignore[attr-defined]
    text = (FOLDER / "README.md").read_text()
    for picture in re.findall(r"\]\((pictures/[^)]*)\)", text):
        assert (FOLDER / picture).exists(), picture
    for verb, rest in re.findall(r"^ *snr (\w+)(.*)$", text, flags=re.MULTILINE):
        known = {option for parameter in verbs[verb].params for option in parameter.opts}
        assert set(re.findall(r" (--[a-z-]+)", rest.partition("  #")[0])) <= known, rest


def test_the_reference_gets_all_points_on_hidden_cases_too(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out(*FLIGHTS)
    assert mark(LAB, is_hidden=True) == ({}, "")


def test_the_reference_is_stopped_in_the_water_and_swims_on(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out("follows_the_picture", "asks", "time_outs", "trouble", "stops", "recovers", "swims")
    assert mark(LAB) == ({}, "")


@pytest.mark.slow
def test_the_reference_has_points_for_its_swim_and_who_stays_at_the_first_gate_has_none(tmp_path: Path) -> None:
    swims = next(one for one in find_lab(LAB).checks if one.name == "swims")
    for folder, share, told in ((FOLDER / "starter", 0.0, "did not swim"), (HERE / "reference", 1.0, "")):
        shutil.copytree(folder, tmp_path, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
        with Student(tmp_path) as student:
            verdict = swims.judge(student, Case(swims.visible[0], is_visible=True))
        assert (verdict.fraction, told in verdict.hint) == (share, True)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [100, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(101, 150))])
def test_the_reference_has_a_margin_at_every_gate(seed: int) -> None:
    simulation = prepare(Request("urov_gate", seed=seed, controller=str(HERE / "reference" / "mission.py")))
    plant = simulation.plant()
    result = Flight(simulation, plant, simulation.config(plant)).run()
    assert (result.error, result.outcome) == ("", "swum")
    assert max(off_m(simulation.scenario, plant)) < 0.2  # the frame is touched from about 0.4 m on


def off_m(scenario: Any, plant: Any) -> list[float]:
    """How far beside the middle of each gate the vehicle went through it."""
    found = []
    for gate in plant.pool.gates:
        seen = [scenario._seen_from(gate, sample.position_m) for sample in plant.course]
        found += [math.hypot(after[1], after[2]) for before, after in pairwise(seen) if before[0] < 0.0 <= after[0]]
    return found


@pytest.mark.parametrize("name", MISTAKES)
def test_a_wrong_solution_loses_its_own_points(mark: Callable[..., Any], leave_out: Any, name: str) -> None:
    leave_out(*FLIGHTS)
    found = mark(LAB, name, is_hidden=name in ("counts_from_the_start", "remembers_an_early_reset"))
    assert found.lost == MISTAKES[name].lost
    assert MISTAKES[name].hint in found.told


def test_the_starter_fails_politely(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out(*FLIGHTS)
    found = mark(LAB, starter=True)
    assert sum(found.lost.values()) == 80.0
    assert "the emergency stop counts in every state" in found.told
