"""Clock: the only source of time. Wall and virtual clocks have the same interface."""

from __future__ import annotations

from typing import Protocol, runtime_checkable


@runtime_checkable
class Clock(Protocol):
    """Measures the time since the run began; all waiting for a time goes through it."""

    def now_s(self) -> float:
        """Return seconds since the run began; never decreases."""

    def sleep_until(self, time_s: float) -> None:
        """Block until `time_s`; return at once if it has passed."""
