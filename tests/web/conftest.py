"""A running machine with a page, and recorded runs of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.web.dive import Live, parts, record_dive

Record = Callable[..., Path]


@pytest.fixture
def live() -> Live:
    return Live()


@pytest.fixture
def record(tmp_path: Path) -> Record:
    """Return a function that records a dive with more components, or with others, and returns the run folder."""

    def run(*more: Any, until_s: float = 3.0, factories: list[Any] | None = None, name: str = "run") -> Path:
        return record_dive(tmp_path / name, parts(*more) if factories is None else factories, until_s)

    return run
