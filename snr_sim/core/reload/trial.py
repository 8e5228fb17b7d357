"""A trial: whoever begins a loop while the node runs wants to know whether its `setup` works, and cannot wait for ever.

On a thread `setup` fails after `begin` has returned. At the start of a node that ends the node. In a reload the old
loop is to go on instead; so the reload waits for a moment.
"""

from __future__ import annotations

from collections import deque
from queue import Empty, SimpleQueue

from snr_sim.prelude.errors import ComponentFailed


class Trial:
    """Tells one who waits what came of a `setup` on another thread; each side knows whether the other one is there."""

    def __init__(self) -> None:
        self._verdict: SimpleQueue[ComponentFailed | None] = SimpleQueue()
        self._token = deque([None])  # taken by whoever comes first: `pop` is one step, and no lock that is left held

    def report(self, failure: ComponentFailed | None) -> bool:
        """Tell how it went; return whether somebody has waited for that."""
        if not self._is_first():
            return False
        self._verdict.put(failure)
        return True

    def wait(self, patience_s: float) -> ComponentFailed | None:
        """Return what failed, or None if nothing did until the patience is over; from then on nobody waits."""
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
