"""BackOff: delay between attempts to connect, which grows with each failure."""

from __future__ import annotations

from random import Random

RETRY_FIRST_S = 0.05
RETRY_MOST_S = 2.0


class BackOff:
    """Doubles the delay after each failure, up to a maximum; random, so that many clients do not retry at once.

    Args:
        luck: random generator; not the run's: two clients of one seed must differ, too.
    """

    def __init__(self, luck: Random | None = None) -> None:
        self._luck = luck or Random()
        self._most_s = RETRY_FIRST_S

    def next_s(self) -> float:
        """Return the next delay: random, from half of this attempt's maximum up to all of it [s]."""
        most_s, self._most_s = self._most_s, min(RETRY_MOST_S, 2.0 * self._most_s)
        return most_s * self._luck.uniform(0.5, 1.0)

    def forget(self) -> None:
        """Reset to short delays, after a success."""
        self._most_s = RETRY_FIRST_S
