"""The lab "two nodes": its page, its reference with all points, and wrong ones, each with its own loss."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim.scenario.flight import Flight
from snr_sim.scenario.simulation import Request, prepare
from tests.assignments.two_nodes.mistakes import MISTAKES

LAB = "07_two_nodes"
PAGE = Path(__file__).parents[2] / "assignments" / LAB / "README.md"
HERE = Path(__file__).parent / "two_nodes"
# Measured over 36 seeds: at most 0.07 N where 0.5 N are allowed, and 97 % of the time pushed where 90 % are asked for.
KINDS = 5
FLIGHTS = ("lost_and_overtaken", "late", "cut", "narrow", "gone", "watches")
TRIED = {  # flights that each mistake is tried in: the one that shows it, and some that it passes
    "counts_from_when_it_came": ("late", "narrow", "gone"),
    "asks_for_no_age": ("late", "cut"),
    "takes_what_comes_last": ("lost_and_overtaken", "cut"),
    "is_too_careful": ("late",),
    "sends_only_when_heard": ("cut",),
    "trusts_the_link_page": ("cut", "watches"),
    "obeys_when_it_comes": ("late",),
    "disarms_when_it_is_old": ("late", "gone"),
}


def test_all_commands_of_the_page_do_what_it_says(type_page: Callable[..., dict[str, str]]) -> None:
    def solve(folder: Path) -> None:
        shutil.copytree(HERE / "reference", folder / "two_nodes_lab", dirs_exist_ok=True)

    printed = type_page(PAGE, {"snr trace": solve})
    assert any("pushed" in said for command, said in printed.items() if command.endswith("--seed 2"))


def test_the_reference_gets_all_points(mark: Callable[..., Any]) -> None:
    assert mark(LAB) == ({}, "")


def test_the_reference_gets_all_points_on_hidden_cases_of_each_end(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out(*FLIGHTS)
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [7, 9, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(KINDS, KINDS * 50))]
)
def test_the_reference_has_a_margin_on_every_link(seed: int) -> None:
    controller = str(HERE / "reference" / "two_nodes.py")
    simulation = prepare(Request("urov_bad_link", seed=seed, controller=controller))
    plant = simulation.plant()
    result = Flight(simulation, plant, simulation.config(plant)).run()
    assert result.error == ""
    assert (result.metrics["silent_thrust_n"] or 0.0) < 0.25  # N, of 0.5
    assert result.metrics["pushed_share"] is None or result.metrics["pushed_share"] > 0.95  # 0.9 is asked for


@pytest.mark.parametrize("name", MISTAKES)
def test_a_wrong_solution_loses_its_own_points(mark: Callable[..., Any], leave_out: Any, name: str) -> None:
    leave_out(*(flight for flight in FLIGHTS if flight not in TRIED[name]))
    found = mark(LAB, name)
    assert found.lost == MISTAKES[name].lost
    assert MISTAKES[name].hint in found.told


def test_the_starter_fails_politely(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out("lost_and_overtaken", "narrow", "gone", "watches")
    found = mark(LAB, starter=True)
    assert found.lost == {"vehicle_alone": 10.0, "cut": 18.0}
    assert "ask for its age" in found.told
