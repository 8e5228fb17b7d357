"""Timer: how long ago it was made. For programs around nodes; inside a node `self.get_time_s()` is what repeats."""

from __future__ import annotations

from snr_sim.core.clocks import WallClock
from snr_sim.prelude.clock import Clock


class Timer:
    """Counts seconds from when it was made, and is not moved by setting the computer's clock.

    Args:
        clock: whose seconds; a wall clock if not given.

    >>> timer = Timer()
    >>> 0.0 <= timer.current_s() < 60.0
    True
    """

    def __init__(self, clock: Clock | None = None) -> None:
        self._clock = clock or WallClock()
        self._start_s = self._clock.now_s()

    def current_s(self) -> float:
        """Return seconds since it was made."""
        return self._clock.now_s() - self._start_s
