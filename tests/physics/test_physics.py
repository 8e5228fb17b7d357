"""The vehicle compared with solutions without a simulation, at 2, 5 and 10 ms: the cases in physics_cases/."""

import importlib
import math
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

HERE = Path(__file__).parent


def the_table() -> ModuleType:
    """physics_table.py, imported as if it were run: with its folder on the path, and only then."""
    sys.path.insert(0, str(HERE))
    try:
        return importlib.import_module("physics_table")
    finally:
        sys.path.remove(str(HERE))


table = the_table()

CASES = table.cases()
PAGE = table.PAGE.read_text(encoding="utf-8")


def shown_alike(cell: str, shown: str, min_error: float) -> bool:
    """Whether two errors, shown to one digit, can be the same but for how another computer rounds."""
    one, other = float(cell), float(shown)
    digit = 10.0 ** math.floor(math.log10(max(abs(one), abs(other), min_error)))
    return abs(one - other) <= 1.01 * digit or max(abs(one), abs(other)) < 2.0 * min_error


def errors_alike(case: Any, steps_s: tuple[float, ...]) -> None:
    """Hold a case at some of the page's steps against its reference, and against its line on the page."""
    line = next(line for line in PAGE.splitlines() if line.startswith(f"| {case.name} |"))
    ours = {step_s: case.run(step_s) for step_s in steps_s}
    now = table.row(case, [ours.get(step_s, math.nan) for step_s in table.STEPS_S])
    assert all(abs(case.error(value)) <= case.allowed for value in ours.values()), now
    *before, _, e2, e5, e10, allowed = (cell.strip() for cell in line.strip("|").split("|"))
    *fresh, _, f2, f5, f10, f_allowed = (cell.strip() for cell in now.strip("|").split("|"))
    assert (before, allowed) == (fresh, f_allowed)
    pairs = dict(zip(table.STEPS_S, ((e2, f2), (e5, f5), (e10, f10)), strict=True))
    assert all(shown_alike(*pairs[step_s], table.min_shown_error(case)) for step_s in steps_s), now


def every_case(lane_of_most: Any) -> Any:
    """Return all cases as parameters; two of three run in a later lane."""
    marked = [(case, [lane_of_most] if i % 3 else []) for i, case in enumerate(CASES)]
    return pytest.mark.parametrize("case", [pytest.param(case, id=case.name, marks=marks) for case, marks in marked])


FAST_STEPS_S = (0.005,)


@every_case(pytest.mark.slow)
def test_error_at_5_ms_equals_physics_page(case: Any) -> None:
    errors_alike(case, FAST_STEPS_S)


@pytest.mark.slow
@every_case(pytest.mark.nightly)
def test_error_at_2_and_10_ms_equals_physics_page(case: Any) -> None:
    errors_alike(case, tuple(step_s for step_s in table.STEPS_S if step_s not in FAST_STEPS_S))


def test_physics_page_has_each_case_once() -> None:
    lines = [line for line in PAGE.splitlines() if line.startswith("| ") and not line.startswith("| Case")]
    assert [line.split(" | ")[0][2:] for line in lines] == [case.name for case in CASES]
    assert len({case.name for case in CASES}) == len(CASES)


def test_physics_page_begins_with_generated_text() -> None:
    assert PAGE.startswith(table.HEAD)
