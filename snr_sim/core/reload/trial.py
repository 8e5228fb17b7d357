"""Trial: the result of a loop's `setup`, for a caller that adds the loop to a running node and waits with a timeout.

On a thread, `setup` fails after `begin` has returned. At the start of a node, such a failure ends the node. In a
reload the old loop has to continue instead; so the reload waits a short time for the result.
"""

from __future__ import annotations

from collections import deque
from queue import Empty, SimpleQueue

from snr_sim.prelude.errors import ComponentFailed


class Trial:
    """Result of a `setup` on another thread, for one caller that waits; each side learns whether the other is there."""

    def __init__(self) -> None:
        self._verdict: SimpleQueue[ComponentFailed | None] = SimpleQueue()
        self._token = deque([None])  # the first side takes it: `pop` is atomic, and no lock can stay held

    def report(self, failure: ComponentFailed | None) -> bool:
        """Set the result; return whether a caller was waiting for it."""
        if not self._is_first():
            return False
        self._verdict.put(failure)
        return True

    def wait(self, patience_s: float) -> ComponentFailed | None:
        """Wait for the result; return the failure, or None after success or the timeout, which ends the trial."""
        try:
            return self._verdict.get(timeout=patience_s)
        except Empty:
            return None if self._is_first() else self._verdict.get()

    def _is_first(self) -> bool:
        try:
            self._token.pop()
        except IndexError:
            return False
        return True
