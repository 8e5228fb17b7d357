"""Each lab is whole: a page with all its parts and the points of its checks, a starter, a solution, wrong ones."""

import ast
import importlib
import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from typer.main import get_command

from snr_sim.cli.main import app
from snr_sim.grading.lab.lab import find_lab
from tests.assignments.mistakes import mistakes_of

HERE = Path(__file__).parent
LABS = sorted((HERE.parents[1] / "assignments").glob("[0-9]*"))


def test_labs_are_numbered_and_listed() -> None:
    assert len(LABS) >= 12
    assert [int(lab.name[:2]) for lab in LABS] == list(range(1, len(LABS) + 1))
    listed = (LABS[0].parent / "README.md").read_text()
    assert [lab.name for lab in LABS if f"({lab.name}/README.md)" not in listed] == []


@pytest.mark.parametrize("lab", LABS, ids=lambda lab: lab.name)
def test_page_contains_goal_duration_and_points(lab: Path) -> None:
    text = (lab / "README.md").read_text()
    for part in ("**Goal.**", "3 to 5 hours", "**You need**", "## The idea", "## What to do", "## How it is graded"):
        assert part in text, part
    rows = re.findall(r"^\| (\d+) \|", text.partition("## How it is graded")[2], flags=re.MULTILINE)
    assert [float(points) for points in rows] == [check.points for check in find_lab(lab.name).checks]


@pytest.mark.parametrize("lab", LABS, ids=lambda lab: lab.name)
def test_commands_and_pictures_of_page_exist(lab: Path) -> None:
    verbs: Any = get_command(app)
    text = (lab / "README.md").read_text()
    for picture in re.findall(r"\]\((pictures/[^)]*)\)", text):
        assert (lab / picture).is_file(), picture
    for verb, rest in re.findall(r"^ *snr (\w+)(.*)$", text, flags=re.MULTILINE):
        known = {option for parameter in verbs.get_command(None, verb).params for option in parameter.opts}
        assert set(re.findall(r" (--[a-z-]+)", rest.partition("  #")[0])) <= known, rest


PARSERS = {"ast", "configparser", "csv", "pickle", "tarfile", "tokenize", "tomllib", "xml", "zipfile"}


@pytest.mark.parametrize("lab", LABS, ids=lambda lab: lab.name)
def test_structured_text_is_parsed_in_the_process_of_the_student(lab: Path) -> None:
    """A parser can take any time: `checks.py` has none, and hands one of its folder to `Student.parse` alone."""
    tree = ast.parse((lab / "checks.py").read_text())
    imported = {(alias.name, "") for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            imported |= {((node.module or ""), alias.name) for alias in node.names}
    assert {module.partition(".")[0] for module, _ in imported} & PARSERS == set()
    with_parser = [
        path.stem
        for path in lab.glob("grader/*.py")
        if any(re.search(rf"^(import|from) {name}\b", path.read_text(), re.MULTILINE) for name in PARSERS)
    ]
    names = {
        name
        for module, name in imported
        if module.removeprefix("grader.") in with_parser
        and f"def {name}(" in (lab / "grader" / f"{module.removeprefix('grader.')}.py").read_text()  # or a constant
    }
    uses = [node for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in names]
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)]
    handed_over = [argument for call in calls if call.func.attr == "parse" for argument in call.args]
    assert [node.id for node in uses if node not in handed_over] == []
    assert len(uses) >= len(with_parser)


@pytest.mark.parametrize("lab", LABS, ids=lambda lab: lab.name)
def test_lab_has_files_reference_and_four_tested_mistakes(lab: Path) -> None:
    name = lab.name.partition("_")[2]
    assert [file for file in find_lab(lab.name).files if not (lab / "starter" / file).is_file()] == []
    assert any((HERE / name).glob("reference/*"))
    mistakes = mistakes_of(lab.name)
    assert len(mistakes) >= 4
    tests = importlib.import_module(f"tests.assignments.test_{name}")
    assert set(mistakes) - parameters(tests) - texts(tests) == set()


def parameters(module: ModuleType) -> set[Any]:
    """Return all values that the tests of a module are parametrised with."""
    marks = [mark for one in vars(module).values() for mark in getattr(one, "pytestmark", [])]
    rows = [getattr(row, "values", row) for mark in marks if mark.name == "parametrize" for row in mark.args[1]]
    return {value for row in rows for value in (row if isinstance(row, tuple) else (row,)) if isinstance(value, str)}


def texts(module: ModuleType) -> set[str]:
    """Return all texts that the tests of a module pass to a function."""
    calls = [node for node in ast.walk(ast.parse(inspect.getsource(module))) if isinstance(node, ast.Call)]
    return {one.value for call in calls for one in call.args if isinstance(one, ast.Constant)}


@pytest.mark.parametrize("lab", LABS, ids=lambda lab: lab.name)
def test_hidden_cases_differ_from_visible_and_depend_on_secret(lab: Path) -> None:
    drawn = [check for check in find_lab(lab.name).checks if check.hidden is not None]
    assert sum(check.points for check in drawn) >= 40.0
    for check in drawn:
        ways = [
            [case.value for case in check.cases(lab.name, secret) if not case.is_visible]
            for secret in (b"one secret of these tests", b"another secret", b"and a third one")
        ]
        # A moment that is drawn to 0.01 s may happen to be the visible one: not all of a check's.
        assert all(any(value not in check.visible for value in way) for way in ways), check.name
        assert any(way != ways[0] for way in ways), check.name
