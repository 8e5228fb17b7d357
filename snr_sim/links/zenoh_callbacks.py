"""ZenohCallbacks: the threads on which one session of Zenoh calls back, so that its end can be waited for."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any


class ZenohCallbacks:
    """Make callbacks and wait until the threads that Zenoh (1.10) starts for them have ended.

    Zenoh starts a Python thread for each callback, a daemon where the declaring thread is one, and ends it when the
    session closes or a query is over. `Session.close` does not wait for that. Up to Python 3.13, a daemon that takes
    Python's lock while the interpreter ends is unwound through Zenoh's Rust frames, which aborts the whole process
    ("FATAL: exception not rethrown"). So whoever ends the program has to wait for these threads first.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._open = 0  # callbacks whose thread has not begun to end
        self._ending: list[threading.Thread] = []

    def make(self, wrap: Callable[..., Any], callback: Callable[[Any], None]) -> Any:
        """Return `callback` as a handler.

        Args:
            wrap: zenoh.handlers.Callback.
            callback: takes what Zenoh brings.
        """
        with self._changed:
            self._open += 1
        return wrap(callback, self._end)

    def _end(self) -> None:
        """Note that this thread ends; Zenoh calls it there, after the last call of the callback."""
        with self._changed:
            self._open -= 1
            self._ending = [thread for thread in self._ending if thread.is_alive()]
            self._ending.append(threading.current_thread())
            self._changed.notify_all()

    def wait(self, timeout_s: float) -> bool:
        """Wait until all threads have ended, for `timeout_s` at most, and return whether they have."""
        until_s = time.monotonic() + timeout_s
        with self._changed:
            if not self._changed.wait_for(lambda: self._open == 0, timeout_s):
                return False
            ending = list(self._ending)
        for thread in ending:
            thread.join(max(0.0, until_s - time.monotonic()))
        return not any(thread.is_alive() for thread in ending)
