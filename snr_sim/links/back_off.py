"""BackOff: how long whoever calls in vain waits before the next call."""

from __future__ import annotations

from random import Random

RETRY_FIRST_S = 0.05
RETRY_MOST_S = 2.0


class BackOff:
    """Waits grow to twice the last, up to a most; each is cut by chance, so that many who wait do not call together.

    Args:
        luck: behind the chance; not the run's: two clients of one seed must differ, too.
    """

    def __init__(self, luck: Random | None = None) -> None:
        self._luck = luck or Random()
        self._most_s = RETRY_FIRST_S

    def next_s(self) -> float:
        """Return how long to wait now: from half of the most for this try up to all of it [s]."""
        most_s, self._most_s = self._most_s, min(RETRY_MOST_S, 2.0 * self._most_s)
        return most_s * self._luck.uniform(0.5, 1.0)

    def forget(self) -> None:
        """Begin with short waits again: a call has come through."""
        self._most_s = RETRY_FIRST_S
