"""A plugin for pytest: hypothesis tries few examples, for the emulated processor takes ten times as long for each."""

from __future__ import annotations

import pytest
from hypothesis import settings


def pytest_configure(config: pytest.Config) -> None:
    settings.register_profile("few", max_examples=10, deadline=None)
    settings.load_profile("few")
