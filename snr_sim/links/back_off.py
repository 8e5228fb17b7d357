"""BackOff: delay between attempts to connect, which grows with each failure."""

from __future__ import annotations

from random import Random

RETRY_FIRST_S = 0.05
MAX_RETRY_S = 2.0


class BackOff:
    """Doubles the delay after each failure, up to a maximum; random, so that many clients do not retry at once.

    Args:
        rng: random generator; not the run's: two clients of one seed must differ, too.
    """

    def __init__(self, rng: Random | None = None) -> None:
        self._rng = rng or Random()
        self._max_s = RETRY_FIRST_S

    def next_s(self) -> float:
        """Return the next delay: random, from half of this attempt's maximum up to all of it [s]."""
        max_s, self._max_s = self._max_s, min(MAX_RETRY_S, 2.0 * self._max_s)
        return max_s * self._rng.uniform(0.5, 1.0)

    def reset(self) -> None:
        """Reset to short delays, after a success."""
        self._max_s = RETRY_FIRST_S
