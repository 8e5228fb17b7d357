"""Cases of one test: in the fast lane as many as show a defect, in the slow one others, at night all."""

from typing import Any

import pytest


def slow(*values: Any) -> Any:
    """Return one case for `parametrize`, tried in the slow lane."""
    return pytest.param(*values, marks=pytest.mark.slow)


def nightly(*values: Any) -> Any:
    """Return one case for `parametrize`, tried at night."""
    return pytest.param(*values, marks=pytest.mark.nightly)
