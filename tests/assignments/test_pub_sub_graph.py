"""The lab "pub-sub graph": its page, its reference with all points, and wrong ones, each with its own loss."""

import ast
import shutil
from collections.abc import Callable
from pathlib import Path
from statistics import NormalDist, fmean, pstdev
from typing import Any

import pytest

from snr_sim.grading.lab.lab import Case, find_lab
from snr_sim.grading.lab.student import Student
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.mistakes import write_solution, write_starter
from tests.assignments.pub_sub_graph.mistakes import MISTAKES

LAB = "04_pub_sub_graph"
PAGE = Path(__file__).parents[2] / "assignments" / LAB / "README.md"
HERE = Path(__file__).parent / "pub_sub_graph"
# A grading uses four runs with four limits each; at most one of 10 000 gradings may fail by chance.
DEVIATIONS = -NormalDist().inv_cdf(1e-4 / 16)
LIMITS = {
    "settling_s": 8.0,
    "overshoot_deg": 12.0,
    "steady_error_deg": 5.0,
    "depth_error_m": 0.2,
}  # urov_heading_hold's


@pytest.mark.nightly  # those of lab 1 and 11 are tried before each landing
def test_commands_of_page_have_documented_results(type_page: Callable[..., dict[str, str]]) -> None:
    def solve(folder: Path) -> None:
        shutil.copytree(HERE / "reference", folder / "graph_lab", dirs_exist_ok=True)

    printed = type_page(PAGE, {"snr check": solve})
    assert any(
        "held" in output
        for command, output in printed.items()
        if command.endswith("heading=gentle --out graph_lab/gentle")
    )


def test_reference_gets_all_points_on_hidden_cases(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out("holds_heading")  # the page's commands have shown that it does
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mistake", "hint"),
    [
        ("never_takes_gentle", MISTAKES["never_takes_gentle"].hint),
        ("", "no component in graph.py stores a page 'turn'"),  # the starter
    ],
)
def test_ignored_gentle_option_fails_with_hint(mistake: str, hint: str, tmp_path: Path) -> None:
    holds_heading = next(one for one in find_lab(LAB).checks if one.name == "holds_heading")
    if mistake:
        write_solution(LAB, tmp_path, mistake)
    else:
        write_starter(LAB, tmp_path)
    with Student(tmp_path) as student:
        verdict = holds_heading.evaluate(student, Case(holds_heading.visible[1], is_visible=True))
    assert (verdict.fraction, hint in verdict.hint) == (0.0, True)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, pytest.param(50, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("heading", ["plain", "gentle"])
def test_reference_has_margin_in_each_turn(heading: str, count: int) -> None:
    found = [turn(heading, seed) for seed in range(100, 100 + count)]
    for name, limit in LIMITS.items():
        values = [one[name] for one in found]
        assert max(values) < 0.8 * limit, name
        if count >= 50:
            assert limit > fmean(values) + DEVIATIONS * pstdev(values), name


def turn(heading: str, seed: int) -> dict[str, Any]:
    """The metrics of one turn."""
    controller = str(HERE / "reference" / "graph.py")
    simulation = prepare(Request("urov_heading_hold", seed=seed, controller=controller, options={"heading": heading}))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert (result.error, result.outcome) == ("", "held")
    return result.metrics


@pytest.mark.parametrize("name", [name for name in MISTAKES if "holds_heading" not in MISTAKES[name].lost])
def test_wrong_solution_loses_listed_points(mark: Callable[..., Any], leave_out: Any, name: str) -> None:
    leave_out("holds_heading")
    found = mark(LAB, name)
    assert found.lost == MISTAKES[name].lost
    assert MISTAKES[name].hint in found.feedback


def test_starter_runs_and_fails_with_hints(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out("holds_heading")
    found = mark(LAB, starter=True)
    assert sum(found.lost.values()) == 85.0
    assert "by itself stores no page 'turn'" in found.feedback
    assert "it imports shared" in found.feedback


@pytest.mark.parametrize(
    "source",
    ["f=" + "lambda:" * 2000 + "0", "".join(" " * i + "def f():\n" for i in range(90)) + " " * 90 + "x = 1"],
    ids=["lambdas", "functions"],
)
def test_nested_functions_are_searched_once(source: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = find_lab(LAB).module("grader.shared_state")
    seen: list[ast.AST] = []
    monkeypatch.setattr(module, "_changed", lambda node, classes: seen.append(node) or "")
    assert module.find_shared_state(source.encode()) == {"shares": [], "keeps": None}
    assert 90 < len(seen) == len(set(map(id, seen)))
