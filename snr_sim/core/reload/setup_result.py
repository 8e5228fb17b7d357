"""The result of a loop's `setup`, for a caller that adds the loop to a running node and waits with a timeout.

On a thread, `setup` fails after `begin` has returned. At the start of a node, such a failure ends the node. In a
reload the old loop has to continue instead; so the reload waits a short time for the result.
"""

from __future__ import annotations

from collections import deque
from queue import Empty, SimpleQueue

from snr_sim.prelude.errors import ComponentFailedError


class SetupResult:
    """Result of a `setup` on another thread, for one caller that waits; each side learns whether the other is there."""

    def __init__(self) -> None:
        self._result: SimpleQueue[ComponentFailedError | None] = SimpleQueue()
        self._token = deque([None])  # the first side takes it: `pop` is atomic, and no lock can stay held

    def set_result(self, failure: ComponentFailedError | None) -> bool:
        """Set the result; return whether a caller was waiting for it."""
        if not self._is_first():
            return False
        self._result.put(failure)
        return True

    def wait(self, timeout_s: float) -> ComponentFailedError | None:
        """Wait for the result; return the failure, or None after success or the timeout, which ends the wait."""
        try:
            return self._result.get(timeout=timeout_s)
        except Empty:
            return None if self._is_first() else self._result.get()

    def _is_first(self) -> bool:
        try:
            self._token.pop()
        except IndexError:
            return False
        return True
