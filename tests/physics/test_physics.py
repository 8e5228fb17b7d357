"""Vehicles compared with solutions without a simulation, at three steps: the cases in physics_cases/."""

import importlib
import math
import sys
from collections.abc import Sequence
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

PAGES = list(table.PAGES.values())
CASES = [(page, case) for page in PAGES for case in page.cases()]


def shown_alike(cell: str, shown: str, min_error: float) -> bool:
    """Whether two errors, shown to one digit, can be the same but for how another computer rounds."""
    one, other = float(cell), float(shown)
    digit = 10.0 ** math.floor(math.log10(max(abs(one), abs(other), min_error)))
    return abs(one - other) <= 1.01 * digit or max(abs(one), abs(other)) < 2.0 * min_error


def errors_alike(page: Any, case: Any, steps_s: Sequence[float]) -> None:
    """Hold a case at some of the page's steps against its reference, and against its line on the page."""
    text = page.path.read_text(encoding="utf-8")
    line = next(line for line in text.splitlines() if line.startswith(f"| {case.name} |"))
    ours = {step_s: case.run(step_s) for step_s in steps_s}
    now = table.row(case, [ours.get(step_s, math.nan) for step_s in page.steps_s])
    assert all(abs(case.error(value)) <= case.allowed for value in ours.values()), now
    *before, _, e1, e2, e3, allowed = (cell.strip() for cell in line.strip("|").split("|"))
    *fresh, _, f1, f2, f3, f_allowed = (cell.strip() for cell in now.strip("|").split("|"))
    assert (before, allowed) == (fresh, f_allowed)
    pairs = dict(zip(page.steps_s, ((e1, f1), (e2, f2), (e3, f3)), strict=True))
    assert all(shown_alike(*pairs[step_s], table.min_shown_error(case)) for step_s in steps_s), now


def every_case(later_lane: Any) -> Any:
    """Return all cases as parameters; four of five, and the long ones, run in a later lane."""
    marked = [(page, case, [later_lane] if i % 5 or case.is_long else []) for i, (page, case) in enumerate(CASES)]
    params = [pytest.param(page, case, id=f"{page.robot}: {case.name}", marks=marks) for page, case, marks in marked]
    return pytest.mark.parametrize(("page", "case"), params)


@every_case(pytest.mark.slow)
def test_error_at_own_step_equals_physics_page(page: Any, case: Any) -> None:
    errors_alike(page, case, page.steps_s[1:2])


@pytest.mark.slow
@every_case(pytest.mark.nightly)
def test_errors_at_other_steps_equal_physics_page(page: Any, case: Any) -> None:
    errors_alike(page, case, page.steps_s[::2])


@pytest.mark.parametrize("page", PAGES, ids=[page.robot for page in PAGES])
def test_physics_page_is_the_generated_text_with_each_case_once(page: Any) -> None:
    text = page.path.read_text(encoding="utf-8")
    assert text.startswith(page.about)
    lines = [line for line in text.splitlines() if line.startswith("| ") and not line.startswith("| Case")]
    names = [case.name for case in page.cases()]
    assert [line.split(" | ")[0][2:] for line in lines] == names
    assert len(set(names)) == len(names)
