"""The lab "hello thruster": the reference gets all points, each mistake costs its own, the starter is a beginner's."""

from __future__ import annotations

import ast
import shutil
from collections.abc import Callable
from pathlib import Path
from statistics import fmean, pstdev
from typing import Any

import pytest

from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.hello_thruster.mistakes import MISTAKES

LAB = "01_hello_thruster"
FOLDER = Path(__file__).parents[2] / "assignments" / LAB
REFERENCE = Path(__file__).parent / "hello_thruster" / "reference" / "hello_thruster.py"
STARTER = FOLDER / "starter" / "hello_thruster.py"

# What was measured with the reference over 25 seeds: mean, standard deviation, and the limit of `urov_sticks`.
SPREAD = {"down_m": (2.170, 0.095, 1.0), "ahead_m": (0.568, 0.009, 0.4), "up_m": (1.176, 0.061, 0.4)}


def test_reference_gets_all_points(mark: Callable[..., Any]) -> None:
    result = mark(LAB, is_hidden=True, single_hidden=["dives"])
    assert result.lost == {}, result.feedback


@pytest.mark.parametrize("name", MISTAKES)
def test_wrong_solution_loses_listed_points_and_gets_hint(name: str, mark: Callable[..., Any]) -> None:
    result = mark(LAB, name, is_hidden=True, single_hidden=["dives"])
    assert result.lost == pytest.approx(MISTAKES[name].lost, abs=0.001), result.feedback
    assert MISTAKES[name].hint in result.feedback


def test_starter_runs_and_gets_first_hint(mark: Callable[..., Any]) -> None:
    assert "Start with pulses_us" in mark(LAB, starter=True).feedback


def test_commands_of_page_have_documented_results(type_page: Callable[..., dict[str, str]]) -> None:
    def solved(here: Path) -> None:
        shutil.copy(REFERENCE, here / "hello_thruster")

    printed = type_page(FOLDER / "README.md", after={"--out hello_thruster/first": solved})
    assert any("descended only 0.00 m of the required 1 m" in output for output in printed.values())


def concepts(source: str) -> set[str]:
    """Names that are new to a student: what is imported, what classes derive from, what must be defined for the kit."""
    tree = ast.parse(source)
    imported = {name.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for name in node.names}
    bases = {ast.unparse(base) for node in ast.walk(tree) if isinstance(node, ast.ClassDef) for base in node.bases}
    required = {"factories", "get", "__init__", "begin", "setup", "loop", "halt", "terminate"}
    defined = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name in required}
    return imported | bases | defined


# What a first course of Python has: functions, variables, lists, dicts, loops, conditions, calls, and imports.
FIRST_COURSE = (
    *(ast.Module, ast.Import, ast.ImportFrom, ast.alias, ast.FunctionDef, ast.arguments, ast.arg, ast.Return),
    *(ast.Assign, ast.AugAssign, ast.Expr, ast.If, ast.For, ast.While, ast.Call, ast.Name, ast.Attribute),
    *(ast.Subscript, ast.Slice, ast.Constant, ast.List, ast.Tuple, ast.Dict, ast.Compare, ast.BoolOp, ast.BinOp),
    *(ast.UnaryOp, ast.expr_context, ast.operator, ast.unaryop, ast.boolop, ast.cmpop),
)


def lines_beyond_a_first_course(source: str) -> set[int]:
    """Lines that use what a first course has not: classes and what lives in them, or the kit's own types."""
    beyond: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        name = node.id if isinstance(node, ast.Name) else node.arg if isinstance(node, ast.arg) else ""
        if (not isinstance(node, FIRST_COURSE) or name in ("self", "TaskType")) and hasattr(node, "lineno"):
            beyond.add(node.lineno)
    return beyond


def lines_of_code(source: str) -> set[int]:
    """Lines on which something stands that Python does: no docstrings, no remarks."""
    texts: set[int] = set()
    code: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            texts |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        elif isinstance(node, ast.stmt | ast.expr):
            code.add(node.lineno)
    return code - texts


def test_starter_has_at_most_four_new_concepts() -> None:
    assert concepts(STARTER.read_text()) == {"Endpoint", "handles", "wired", "factories"}


def test_four_fifths_of_starter_lines_are_beginner_python() -> None:
    source = STARTER.read_text()
    beyond, code = lines_beyond_a_first_course(source), lines_of_code(source)
    assert beyond < code
    assert len(beyond) <= 0.2 * len(code), [source.splitlines()[number - 1] for number in sorted(beyond)]


def test_advanced_python_is_detected() -> None:
    assert lines_beyond_a_first_course("a = 1\nclass B(C):\n    d = [e for e in a]\n    f = self.g\n") == {2, 3, 4}


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, pytest.param(25, marks=pytest.mark.nightly)])
def test_dive_limits_are_10_sigma_from_reference(count: int, tmp_path: Path) -> None:
    shutil.copytree(FOLDER / "starter", tmp_path, dirs_exist_ok=True)
    shutil.copy(REFERENCE, tmp_path)
    found = []
    for seed in range(100, 100 + count):
        simulation = prepare(Request("urov_sticks", seed=seed, controller=str(tmp_path / "hello_thruster.py")))
        plant = simulation.plant()
        found.append(SimulationRun(simulation, plant, simulation.config(plant)).run().metrics)
    assert [one["disarmed_n"] for one in found] == [0.0] * count
    for name, (mean, sd, limit) in SPREAD.items():
        values = [one[name] for one in found]
        assert limit < mean - 10.0 * sd
        assert all(abs(value - mean) < 4.0 * sd for value in values), name
        if count >= 25:
            assert limit < fmean(values) - 10.0 * pstdev(values), name
