"""Cases of one test: in the fast lane as many as show a defect, in the slow one all others."""

from typing import Any

import pytest


def slow(*values: Any) -> Any:
    """Return one case for `parametrize`, tried in the slow lane."""
    return pytest.param(*values, marks=pytest.mark.slow)
