"""TokenBucket: a limit on the rate of something, with bursts."""

from __future__ import annotations


class TokenBucket:
    """A token bucket that is full at first, and fills at a rate in tokens per second."""

    def __init__(self, rate_hz: float, capacity: float) -> None:
        self._rate_hz = rate_hz
        self._capacity = capacity
        self._left = capacity
        self._filled_s = float("-inf")

    def take(self, now_s: float) -> bool:
        """Take a token if there is one; return whether there was.

        >>> bucket = TokenBucket(rate_hz=10.0, capacity=2)
        >>> [bucket.take(now_s) for now_s in (0.0, 0.0, 0.0, 0.1)]
        [True, True, False, True]
        """
        self._left = min(self._capacity, self._left + (now_s - self._filled_s) * self._rate_hz)
        self._filled_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
