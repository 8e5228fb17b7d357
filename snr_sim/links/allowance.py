"""Allowance: a limit on the rate of something, with bursts; a token bucket."""

from __future__ import annotations


class Allowance:
    """A token bucket.

    Args:
        rate_hz: rate at which it fills, in tokens per second.
        most: its capacity; it is full at first.
    """

    def __init__(self, rate_hz: float, most: float) -> None:
        self._rate_hz = rate_hz
        self._most = most
        self._left = most
        self._filled_s = float("-inf")

    def take(self, now_s: float) -> bool:
        """Take a token if there is one; return whether there was.

        >>> allowance = Allowance(rate_hz=10.0, most=2)
        >>> [allowance.take(now_s) for now_s in (0.0, 0.0, 0.0, 0.1)]
        [True, True, False, True]
        """
        self._left = min(self._most, self._left + (now_s - self._filled_s) * self._rate_hz)
        self._filled_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
