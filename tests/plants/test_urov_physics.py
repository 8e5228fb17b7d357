"""The vehicle beside what is known without a simulation, at 2, 5 and 10 ms: cases of robots/urov/physics_cases.py."""

import importlib.util
import math
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

UROV = Path(__file__).parents[2] / "robots" / "urov"


def load(name: str) -> ModuleType:
    """A file beside the robot, under the name by which its neighbours import it."""
    spec = importlib.util.spec_from_file_location(name, UROV / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


load("fossen_rk4")
physics = load("physics_cases")
table = load("physics_table")

CASES = physics.cases()
PAGE = (UROV / "PHYSICS.md").read_text(encoding="utf-8")


def shown_alike(cell: str, shown: str, least: float) -> bool:
    """Whether two errors, shown to one digit, can be the same but for how another computer rounds."""
    one, other = float(cell), float(shown)
    digit = 10.0 ** math.floor(math.log10(max(abs(one), abs(other), least)))
    return abs(one - other) <= 1.01 * digit or max(abs(one), abs(other)) < 2.0 * least


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_the_plant_is_as_near_to_the_reference_as_the_page_says(case: Any) -> None:
    line = next(line for line in PAGE.splitlines() if line.startswith(f"| {case.name} |"))
    ours = [case.run(step_s) for step_s in physics.STEPS_S]
    now = table.row(case, ours)
    assert all(abs(case.error(value)) <= case.allowed for value in ours), now
    *before, _, e2, e5, e10, allowed = (cell.strip() for cell in line.strip("|").split("|"))
    *fresh, _, f2, f5, f10, f_allowed = (cell.strip() for cell in now.strip("|").split("|"))
    assert (before, allowed) == (fresh, f_allowed)
    assert all(shown_alike(*pair, table.least_shown(case)) for pair in ((e2, f2), (e5, f5), (e10, f10))), now


def test_the_page_has_each_case_once_and_no_other() -> None:
    lines = [line for line in PAGE.splitlines() if line.startswith("| ") and not line.startswith("| Case")]
    assert [line.split(" | ")[0][2:] for line in lines] == [case.name for case in CASES]
    assert len({case.name for case in CASES}) == len(CASES)
