"""The lab "supervision": all points for the reference, its own for each mistake, and its page."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.assignments.mistakes import Mistake, replace, write_solution
from tests.assignments.supervision.mistakes import MISTAKES

LAB = "15_supervision"
FOLDER = Path(__file__).parents[2] / "assignments" / LAB


def test_reference_gets_all_points(mark: Callable[..., Any]) -> None:
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.parametrize("name", MISTAKES)
def test_wrong_solution_loses_listed_points_and_gets_hint(name: str, mark: Callable[..., Any]) -> None:
    found = mark(LAB, name, is_hidden=True)
    assert found.lost == pytest.approx(MISTAKES[name].lost, abs=0.001), found.feedback
    assert MISTAKES[name].hint in found.feedback


def test_starter_runs_and_gets_first_hints(mark: Callable[..., Any]) -> None:
    feedback = mark(LAB, starter=True).feedback
    assert "plan() has one Child for each part of the rover, in any depth: step 5." in feedback
    assert "It moves by a stick from before its begin" in feedback


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("return sorted(name for", "return print(name for", "hanging returns None"),
        ('return Supervisor(\n        "root",\n        ', "return list(", "plan() returns list"),
        ('Child("navigator", "on_failure")', 'Child("camera")', "has a name twice: camera"),
    ],
)
def test_answer_of_another_type_gets_a_hint(
    mark: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, old: str, new: str, message: str
) -> None:
    mistake = Mistake(
        "Answers with something else.", changes=[replace("supervise.py", old, new)], lost={}, hint=message
    )
    monkeypatch.setitem(MISTAKES, "another type", mistake)
    assert message in mark(LAB, "another type").feedback


@pytest.mark.nightly  # those of lab 1 and 11 are tried before each landing
def test_commands_of_page_have_documented_results(type_page: Callable[..., dict[str, str]]) -> None:
    def solve(here: Path) -> None:
        write_solution(LAB, here / "supervision")

    type_page(FOLDER / "README.md", after={"snr check": solve})
