"""A promise with many cases: in the fast lane as many as show that it is broken, in the slow one all the others."""

from typing import Any

import pytest


def slow(*values: Any) -> Any:
    """Return one case for `parametrize`, tried in the slow lane."""
    return pytest.param(*values, marks=pytest.mark.slow)
