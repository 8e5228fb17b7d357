"""Timer: seconds since its creation. For programs around nodes; in a node `self.get_time_s()` is repeatable."""

from __future__ import annotations

from snr_sim.core.clocks import WallClock
from snr_sim.prelude.clock import Clock


class Timer:
    """Counter of seconds since its creation, by a wall clock if no other is given; setting it has no effect.

    >>> timer = Timer()
    >>> 0.0 <= timer.current_s() < 60.0
    True
    """

    def __init__(self, clock: Clock | None = None) -> None:
        self._clock = clock or WallClock()
        self._start_s = self._clock.now_s()

    def current_s(self) -> float:
        """Return seconds since the creation of the timer."""
        return self._clock.now_s() - self._start_s
