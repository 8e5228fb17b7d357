"""Clock: the only place time comes from. Wall and virtual clocks look the same to everything above."""

from __future__ import annotations

from typing import Protocol, runtime_checkable


@runtime_checkable
class Clock(Protocol):
    """Tells the time since the run began and owns all waiting for it."""

    def now_s(self) -> float:
        """Return seconds since the run began; never goes back."""
        ...

    def sleep_until(self, time_s: float) -> None:
        """Return when `time_s` has come; at once if it has passed."""
        ...
