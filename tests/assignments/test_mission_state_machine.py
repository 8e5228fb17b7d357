"""The lab "mission state machine": its page, its reference with all points, and wrong ones, each with its own loss."""

import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from snr_sim.grading.lab.lab import Case, find_lab
from snr_sim.grading.lab.student import Student
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.mission_state_machine.mistakes import ANOTHER_WAY, FORMS, MISTAKES, use_form
from tests.assignments.mistakes import Mistake, write_solution, write_starter

LAB = "05_mission_state_machine"
FOLDER = Path(__file__).parents[2] / "assignments" / LAB
HERE = Path(__file__).parent / "mission_state_machine"
FLIGHTS = ("runs_mission", "stops_in_the_water")
BY_HIDDEN_CASES = ("timeout_from_run_start", "remembers_an_early_reset")  # mistakes that no visible case shows
# Before each landing some mistakes are tried in the checks that they lose only, and in the others at night.
IN_ALL_CHECKS = [False, pytest.param(True, marks=pytest.mark.nightly)]
# Measured over 19 seeds from 100 on: 0.035 m off the middle, deviation 0.013, so 0.2 m is twelve deviations away.


@pytest.mark.unmeasured
def test_reference_gets_all_points_on_hidden_cases(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out(*FLIGHTS)
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.parametrize("is_hidden", [False, pytest.param(True, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("form", FORMS)
def test_reference_in_another_form_gets_all_points(
    mark: Callable[..., Any], leave_out: Any, monkeypatch: pytest.MonkeyPatch, form: str, is_hidden: bool
) -> None:
    leave_out(*FLIGHTS)
    other = Mistake("No mistake: another way to write the machine.", changes=[use_form(form)], lost={}, hint="")
    monkeypatch.setitem(MISTAKES, form, other)
    assert mark(LAB, form, is_hidden=is_hidden) == ({}, "")


def test_starters_of_other_forms_are_as_good_as_the_first_one(
    mark: Callable[..., Any], leave_out: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    leave_out(*FLIGHTS)
    assert {path.name for path in ANOTHER_WAY.iterdir()} == set(FORMS)
    for form in FORMS:

        def begin(folder: Path, form: str = form) -> None:
            shutil.copytree(FOLDER / "starter", folder, dirs_exist_ok=True)
            shutil.copytree(ANOTHER_WAY / form, folder, dirs_exist_ok=True)

        monkeypatch.setitem(MISTAKES, form, Mistake("Only the starter.", changes=[begin], lost={}, hint=""))
        found = mark(LAB, form)
        shutil.rmtree(tmp_path / "handed_in")
        assert sum(found.lost.values()) == 80.0, form


@pytest.mark.nightly
@pytest.mark.unmeasured
@pytest.mark.usefixtures("warm_children")
def test_other_forms_pass_mission_check_and_starter_fails_it(tmp_path: Path) -> None:
    runs_mission = next(one for one in find_lab(LAB).checks if one.name == "runs_mission")
    for form, share, hint in (("", 0.0, "It did not pass the three gates"), ("table", 1.0, ""), ("text", 1.0, "")):
        if form:
            use_form(form)(write_solution(LAB, tmp_path))
        else:
            write_starter(LAB, tmp_path)
        with Student(tmp_path) as student:
            verdict = runs_mission.evaluate(student, Case(runs_mission.visible[0], is_visible=True))
        assert (verdict.fraction, hint in verdict.hint) == (share, True)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [100, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(101, 150))])
def test_reference_has_margin_at_every_gate(seed: int) -> None:
    simulation = prepare(Request("urov_gate", seed=seed, controller=str(HERE / "reference" / "mission.py")))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert (result.error, result.outcome) == ("", "completed")
    assert max(off_m(simulation.scenario, plant)) < 0.2  # the frame is touched from about 0.4 m on


def off_m(scenario: Any, plant: Any) -> list[float]:
    """Return the lateral distance from the centre of each gate at which the vehicle passed it."""
    found = []
    for gate in plant.pool.gates:
        seen = [scenario._seen_from(gate, sample.position_m) for sample in plant.course]
        found += [math.hypot(after[1], after[2]) for before, after in pairwise(seen) if before[0] < 0.0 <= after[0]]
    return found


@pytest.mark.parametrize("name", [name for name in MISTAKES if name not in BY_HIDDEN_CASES])
def test_wrong_solution_loses_listed_points(mark: Callable[..., Any], leave_out: Any, name: str) -> None:
    leave_out(*FLIGHTS)
    found = mark(LAB, name)
    assert found.lost == MISTAKES[name].lost
    assert MISTAKES[name].hint in found.feedback


@pytest.mark.parametrize("in_all_checks", IN_ALL_CHECKS)
@pytest.mark.parametrize("name", BY_HIDDEN_CASES)
def test_wrong_solution_loses_listed_points_by_hidden_cases(
    mark: Callable[..., Any], leave_out: Any, try_only: Any, name: str, in_all_checks: bool
) -> None:
    leave_out(*FLIGHTS) if in_all_checks else try_only(*MISTAKES[name].lost)
    found = mark(LAB, name, is_hidden=True)
    assert found.lost == MISTAKES[name].lost
    assert MISTAKES[name].hint in found.feedback


@pytest.mark.unmeasured
@pytest.mark.parametrize("in_all_checks", IN_ALL_CHECKS)
@pytest.mark.parametrize(("form", "name"), [(form, name) for form, changes in FORMS.items() for name in changes])
def test_wrong_solution_in_another_form_loses_the_same_points(
    mark: Callable[..., Any],
    leave_out: Any,
    try_only: Any,
    monkeypatch: pytest.MonkeyPatch,
    form: str,
    name: str,
    in_all_checks: bool,
) -> None:
    leave_out(*FLIGHTS) if in_all_checks else try_only(*MISTAKES[name].lost)
    mistake = replace(MISTAKES[name], changes=[use_form(form), *FORMS[form][name]])
    monkeypatch.setitem(MISTAKES, "in another form", mistake)
    found = mark(LAB, "in another form", is_hidden=name in BY_HIDDEN_CASES)
    assert found.lost == mistake.lost
    assert mistake.hint in found.feedback


def test_starter_fails_with_hints(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out(*FLIGHTS)
    found = mark(LAB, starter=True)
    assert sum(found.lost.values()) == 80.0
    assert "the emergency stop counts in every state" in found.feedback
