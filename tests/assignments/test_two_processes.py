"""The lab "two processes": its page, its reference with all points, and wrong ones, each with its own loss."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import find_lab
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.mistakes import write_solution
from tests.assignments.two_processes.mistakes import MISTAKES, RUNS

LAB = "13_two_processes"
FOLDER = Path(__file__).parents[2] / "assignments" / LAB
BORROWED = "snr_sim_robot_housecat"


@cache
def part(name: str) -> Any:
    """Return a module of the lab's folder "grader"."""
    return find_lab(LAB).module(f"grader.{name}")


# -- the page ---------------------------------------------------------------------------------------------------------


@pytest.mark.unmeasured
@pytest.mark.nightly
def test_commands_of_page_have_documented_results(type_page: Callable[..., dict[str, str]]) -> None:
    def solve(folder: Path) -> None:
        write_solution(LAB, folder / "two_lab")

    printed = type_page(FOLDER / "README.md", {"snr check": solve})
    ended = next(output for command, output in printed.items() if "reference.ended" in command)
    assert {"process_2d", "process_3d", "driver"} <= set(re.findall(r"\w+", ended))


# -- the reference ----------------------------------------------------------------------------------------------------


@pytest.mark.unmeasured
@pytest.mark.slow
def test_reference_gets_all_points_on_hidden_cases(mark: Callable[..., Any], leave_out: Callable[..., None]) -> None:
    leave_out("finds", *RUNS)
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.unmeasured
@pytest.mark.nightly(minutes=2)
def test_reference_gets_all_points_on_all_hidden_cases(mark: Callable[..., Any]) -> None:
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.nightly(minutes=2)
@pytest.mark.parametrize(("file", "ranging"), [("stereo.py", "stereo"), ("lidar.py", "lidar"), ("slow.py", "stereo")])
def test_reference_clears_49_of_50_yards(file: str, ranging: str, tmp_path: Path) -> None:
    write_solution(LAB, tmp_path)
    failures = []
    for seed in range(100, 150):
        request = Request("housecat_clear", seed, controller=str(tmp_path / file), options={"ranging": ranging})
        simulation = prepare(request)
        plant = simulation.plant()
        result = SimulationRun(simulation, plant, simulation.config(plant)).run()
        if not result.success:
            failures.append((seed, result.outcome, result.notes))
    assert len(failures) <= 1, failures


# -- wrong ones -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in MISTAKES if name != "the_sum"])
def test_wrong_solution_loses_listed_points(mark: Callable[..., Any], leave_out: Any, name: str) -> None:
    """Only the checks that it loses are tried, without runs; all of them are tried at night."""
    lost = {check: points for check, points in MISTAKES[name].lost.items() if check not in RUNS}
    leave_out(*({one.name for one in find_lab(LAB).checks} - lost.keys() - {"own_process"}))
    found = mark(LAB, name)
    assert found.lost == lost
    assert MISTAKES[name].hint in found.feedback


@pytest.mark.unmeasured
@pytest.mark.nightly(minutes=4)
@pytest.mark.parametrize("name", [name for name in MISTAKES if name != "the_sum"])
def test_wrong_solution_loses_listed_points_in_runs(mark: Callable[..., Any], name: str) -> None:
    assert mark(LAB, name).lost == MISTAKES[name].lost


@pytest.mark.slow
def test_wrong_answer_loses_listed_points(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out("finds", "follows_states", "clears_by_stereo", "clears_by_lidar")
    found = mark(LAB, "the_sum")
    assert found.lost == MISTAKES["the_sum"].lost
    assert MISTAKES["the_sum"].hint in found.feedback


@pytest.mark.slow
def test_starter_fails_with_hints(mark: Callable[..., Any]) -> None:
    found = mark(LAB, starter=True)
    assert sum(found.lost.values()) == 95.0
    assert "Which pixels show stones?" in found.feedback
    assert "process_2d published too few events" in found.feedback
    assert "lidar.py is still stereo.py" in found.feedback


@pytest.mark.parametrize(
    ("line", "found"),
    [
        (f"from {BORROWED}.process_2d import PROCESS_2D", f"{BORROWED}.process_2d.PROCESS_2D"),
        (f"from {BORROWED} import process_2d", f"{BORROWED}.process_2d"),
        (f"import {BORROWED}.process_2d as mine", f"{BORROWED}.process_2d"),
        (f"from {BORROWED}.process_3d import Idle", f"{BORROWED}.process_3d.Idle"),
        (f"from {BORROWED}.states import *", f"{BORROWED}.states.*"),
        (f"from {BORROWED}.vision import nearest_bearing_rad", f"{BORROWED}.vision.nearest_bearing_rad"),
        (f"from {BORROWED}.controllers.clearer import PROCESS_2D", f"{BORROWED}.controllers.clearer.PROCESS_2D"),
        ("from . import process_2d", "None.process_2d"),
        ("import sys", "sys"),
        ("import importlib", "importlib"),
        ("from snr_sim.scenario import library", "snr_sim.scenario.library"),
        (f"__import__('{BORROWED}.process_2d')", "__import__"),
        (f"exec('import {BORROWED}.process_2d')", "exec"),
        ("getattr(1, 'real')", "getattr"),
        ("PROCESS_3D['stereo'].__class__", "__class__"),
        ("def f():\n    return f.__globals__", "__globals__"),
        ("import math\nmath.__loader__", "__loader__"),
        ("__builtins__", "__builtins__"),
        ("import numpy as np\nnp.testing.sys", "sys"),
    ],
)
def test_program_that_borrows_is_refused_with_its_line(line: str, found: str) -> None:
    find_borrowed = part("own_code").find_borrowed
    assert find_borrowed(line.encode()) == f"line {line.count(chr(10)) + 1}: '{found}'"


def test_starter_and_solution_do_not_borrow(tmp_path: Path) -> None:
    find_borrowed = part("own_code").find_borrowed
    for folder in (FOLDER / "starter", write_solution(LAB, tmp_path)):
        assert [find_borrowed(path.read_bytes()) for path in folder.glob("*.py")] == [""] * 5
    assert find_borrowed(b"def (") == "", "the checks that run it report its error"


# -- nonsense ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("check", "old", "new", "hint"),
    [
        ("finds", '"stamp_s": self.stamp_s}', '"stamp_s": None}', "'stamp_s' of the page 'heap_2d' is not a number"),
        ("finds", '{"bearing_rad": bearing_rad, "stamp_s": self.stamp_s}', "5", "The page 'heap_2d' is not a dict"),
        ("finds", '"bearing_rad": bearing_rad', '"bearing_rad": 10**400', "is not finite, or exceeds"),
        ("all_together", '"heap_2d", {"bearing_rad": bearing_rad', '"reference", {"bearing_rad": 0.0', ""),
        (
            "events_once",
            'self.publish_event("HEAP_SEEN")',
            'self.publish_event("NEAR")',
            "are the events of process_2d",
        ),
        ("finds", "self.get_time_s() - self", "1 / 0 - self", "look at the line named"),
    ],
)
@pytest.mark.usefixtures("warm_children")
def test_nonsense_fails_case_with_hint(check: str, old: str, new: str, hint: str, tmp_path: Path) -> None:
    folder = write_solution(LAB, tmp_path / "handed_in")
    text = (folder / "process_2d.py").read_text()
    assert old in text
    (folder / "process_2d.py").write_text(text.replace(old, new))
    lab = find_lab(LAB)
    lab.checks = tuple(replace(one, visible=one.visible[:1], needs=()) for one in lab.checks if one.name == check)
    graded = grade_submission(lab, folder, None, "none")
    assert (graded.status, graded.faults, graded.points) == ("graded", [], 0.0), graded.error
    assert graded.checks[0].cases[0].hint
    assert hint in graded.checks[0].cases[0].hint


# -- the two guarantees -----------------------------------------------------------------------------------------------


def entries(*rows: tuple[str, str, Any]) -> list[Any]:
    """Return entries of a run, one each tenth of a second."""
    rules = part("rules")
    return [rules.Entry(0.1 * i, *row) for i, row in enumerate(rows)]


def state(
    name: str, epoch: int, phase: str = "running", attached: tuple[str, ...] = ("process_2d", "process_3d", "driver")
) -> Any:
    return ("reference", "reference", {"state": name, "epoch": epoch, "phase": phase, "attached": list(attached)})


def ended(name: str, epoch: int = 1) -> Any:
    return (name, "reference.ended", [name, epoch])


ENDED = [ended("process_2d"), ended("process_3d"), ended("driver")]
BEGIN, END, NEXT = state("search", 1), state("search", 1, "ending"), state("approach", 2)


@pytest.mark.parametrize(
    ("rows", "hint"),
    [
        ([BEGIN, END, *ENDED, NEXT], ""),
        ([BEGIN, END, *ENDED[1:], NEXT], "before process_2d had ended the one before"),
        ([BEGIN, END, ("driver", "reference.ended", ["process_2d", 1]), *ENDED[1:], NEXT], "before process_2d had"),
        ([BEGIN, END, ended("process_2d", 0), *ENDED[1:], NEXT], "before process_2d had"),
        ([BEGIN, END, ENDED[0], ("process_2d", "heap_2d", {}), *ENDED[1:], NEXT], "after it had ended its state"),
        ([state("search", 1, attached=("process_3d", "driver"))], "Name all three processes"),
    ],
)
def test_state_that_begins_too_early_is_found(rows: list[Any], hint: str) -> None:
    verdict, changes = part("rules").together(entries(*rows))
    assert (verdict.fraction, hint in verdict.hint) == (0.0 if hint else 1.0, True)
    if not hint:
        assert [(one.epoch, round(one.lasted_s, 6)) for one in changes] == [(1, 0.4)]
        assert max(changes[0].ended_s, key=lambda name: changes[0].ended_s[name]) == "driver"


TABLE = {"search": {"HEAP_SEEN": "approach"}, "approach": {"NEAR": "push"}}


def published(name: str, source: str = "process_2d") -> Any:
    return (source, "reference.publish", [name, source, 1])


def moved(source: str, target: str) -> Any:
    return ("reference", "reference.transition", [{"source": source, "target": target}])


def dropped(name: str) -> Any:
    return ("reference", "reference.dropped", [name, "process_2d", 1, "its state is over"])


@pytest.mark.parametrize(
    ("rows", "hint"),
    [
        ([published("HEAP_SEEN"), moved("search", "approach")], ""),
        ([published("HEAP_SEEN"), published("HEAP_LOST"), moved("search", "approach"), dropped("HEAP_LOST")], ""),
        ([("", "NEAR", []), moved("approach", "push")], ""),
        ([moved("search", "approach")], "without an event"),
        ([published("HEAP_SEEN"), moved("search", "approach"), moved("search", "approach")], "twice for one"),
        ([published("HEAP_LOST"), moved("search", "approach")], "without an event"),
        ([published("HEAP_SEEN"), published("HEAP_LOST"), dropped("HEAP_LOST")], "was not the next one"),
        ([("process_2d", "HEAP_SEEN", [])], "without the epoch"),
        ([published("NEAR")], "It sends no others"),
        ([published("HEAP_SEEN", "driver")], "they are its own"),
    ],
)
def test_event_that_counts_twice_or_never_is_found(rows: list[Any], hint: str) -> None:
    verdict = part("rules").each_event_once(entries(*rows), TABLE)
    assert (verdict.fraction, hint in verdict.hint) == (0.0 if hint else 1.0, True)
