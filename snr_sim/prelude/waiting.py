"""Waits with a timeout that end.

`queue.SimpleQueue.get(timeout=...)` may never end in Python 3.11 and 3.12: woken by a signal, or for an item that
was taken meanwhile, it computes again what time is left, and takes a negative one for "no timeout". A robot at real
speed whose next tick was 20 us away stood still that way. A lock computes the same, and ends the wait.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from queue import Empty
from typing import Generic, TypeVar

Item = TypeVar("Item")


class WakeUp:
    """What one thread waits for, and any thread or signal handler causes. No interrupt leaves it unusable."""

    __slots__ = ("_lock",)

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lock.acquire()  # open only from `wake` to the next `wait`

    def wake(self) -> None:
        """End the wait, or the next one if none has begun."""
        try:
            self._lock.release()
        except RuntimeError:
            return  # `wake` was called before

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait until `wake` is called, or was called since the last wait, or the timeout is over."""
        self._lock.acquire(timeout=-1 if timeout_s is None else timeout_s)


class TimedQueue(Generic[Item]):
    """Queue that any thread or signal handler puts into and one thread takes from, in the order of the puts."""

    def __init__(self) -> None:
        self._items: deque[Item] = deque()
        self._wake_up = WakeUp()

    def put(self, item: Item) -> None:
        """Add an item."""
        self._items.append(item)
        self._wake_up.wake()

    def get(self, timeout_s: float | None = None) -> Item:
        """Remove and return the oldest item; wait for one.

        Raises:
            queue.Empty: there is none after this time.
        """
        end_s = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._items:
            left_s = None if end_s is None else end_s - time.monotonic()
            if left_s is not None and left_s <= 0:
                raise Empty
            self._wake_up.wait(left_s)
        return self._items.popleft()
