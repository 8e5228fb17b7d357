"""The lab "debug by replay": its page, its reference with all points, and wrong ones, each with its own loss."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

LAB = "09_debug_by_replay"
PAGE = Path(__file__).parents[2] / "assignments" / LAB / "README.md"
HERE = Path(__file__).parent / "debug_by_replay"


def test_all_commands_of_the_page_do_what_it_says(type_page: Callable[..., dict[str, str]]) -> None:
    def repair(folder: Path) -> None:
        shutil.copy(HERE / "reference" / "findings.toml", folder / "debug_lab")

    printed = type_page(PAGE, {"--name engine": repair})
    assert "crashed" in next(said for command, said in printed.items() if "failed.py" in command)
    assert "component estimator" in next(said for command, said in printed.items() if "only_1.py" in command)
    assert "landed" in next(said for command, said in printed.items() if "resim" in command)


def test_the_reference_gets_all_points_on_hidden_cases_too(mark: Callable[..., Any]) -> None:
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.parametrize(
    ("wrong", "lost", "says"),
    [
        ("first_command", {"diverges": 10.0}, "not where the commands begin to differ"),
        (
            "two_of_three",
            {"filled_in": 3.333, "diverges": 10.0, "lands": 40.0, "each_is_needed": 15.0},
            "Finding 3 has no repair yet",
        ),
        ("symptom", {"diverges": 20.0}, "one of the two treats what another one does wrong"),
        (
            "without_the_spaces",
            {"filled_in": 3.333, "diverges": 10.0, "lands": 40.0, "each_is_needed": 15.0},
            "with the spaces before it",
        ),
        (
            "failed_code_changed",
            {"unchanged": 5.0, "filled_in": 10.0, "diverges": 30.0, "lands": 40.0, "each_is_needed": 15.0},
            "failed.py has been changed",
        ),
        ("no_causes", {"filled_in": 10.0}, "Say in `cause`, in one line, what is wrong"),
        (
            "not_toml",
            {"filled_in": 10.0, "diverges": 30.0, "lands": 40.0, "each_is_needed": 15.0},
            "findings.toml cannot be read",
        ),
    ],
)
def test_a_wrong_solution_loses_its_own_points(
    mark: Callable[..., Any], wrong: str, lost: dict[str, float], says: str
) -> None:
    found = mark(LAB, wrong)
    assert found.lost == lost
    assert says in found.told


def test_the_starter_fails_politely(mark: Callable[..., Any]) -> None:
    found = mark(LAB, starter=True)
    assert sum(found.lost.values()) == 95.0
    assert "Finding 1 has no repair yet" in found.told
    assert "it crashed" in found.told
