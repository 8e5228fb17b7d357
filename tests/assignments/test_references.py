"""The reference of every lab gets all points of the cases that students see, in the fast lane."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

LABS = sorted(path.parent.name for path in (Path(__file__).parents[2] / "assignments").glob("*/checks.py"))


@pytest.mark.fast  # although `mark` keeps one process for all cases of the session, which are forks of it
@pytest.mark.parametrize("lab", LABS)
def test_reference_gets_all_points_of_visible_cases(lab: str, mark: Callable[..., Any]) -> None:
    result = mark(lab)
    assert result.lost == {}, result.feedback
