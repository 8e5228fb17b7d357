"""RestartingLoop: loop over ports that any program can reach. A failure restarts the loop and never ends its node."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from random import Random

from snr_sim.core.loop import Loop
from snr_sim.links.session import printable_line

RETRY_FIRST_S = 0.05
MAX_RETRY_S = 2.0
STEADY_S = 5.0  # after this long without a failure, the loop waits only briefly before it opens again


class BackOff:
    """Delay between attempts: doubles after each failure, up to a maximum.

    It is random, so that many clients do not retry at once, and independent of the run: two clients of one seed must
    differ, too.

    Args:
        longest_s: the maximum.
    """

    def __init__(self, longest_s: float = MAX_RETRY_S) -> None:
        self._rng = Random()
        self._max_s, self._longest_s = RETRY_FIRST_S, longest_s

    def next_s(self) -> float:
        """Return the next delay: random, from half of this attempt's maximum up to all of it [s]."""
        max_s, self._max_s = self._max_s, min(self._longest_s, 2.0 * self._max_s)
        return max_s * self._rng.uniform(0.5, 1.0)

    def reset(self) -> None:
        """Reset to short delays, after a success."""
        self._max_s = RETRY_FIRST_S


class RestartingLoop(Loop):
    """Calls `_round` repeatedly; if that raises, closes everything and opens it again after a back-off.

    An exception in a loop of the robot is a mistake in the robot and ends the node. An exception here was caused by
    data from the network: another program must not be able to end the robot's program.
    """

    restarts = True  # False in a simulation without ports: a failure there is our own, and ends the node
    failures: int = 0  # errors that no data of a peer should cause: each closed a stream, or the whole loop
    is_shut: bool = False  # from a failure until everything is open again
    _failure = ""  # the last reason, logged once
    _opened_s = float("-inf")

    def _open_ports(self, ports: ExitStack) -> None:
        """Open what the loop waits for, and push callbacks that close it onto `ports`."""
        raise NotImplementedError

    def _round(self) -> None:
        """Wait for an event, and handle it."""
        raise NotImplementedError

    def _drain_and_close(self) -> None:
        """Send the goodbye message to all peers before everything is closed."""

    def _show_down(self, reason: str) -> None:
        """Publish why the loop is shut."""

    def _open(self) -> None:
        with ExitStack() as ports:  # closes what was opened before an exception
            self._open_ports(ports)
            self._ports = ports.pop_all()

    def _shut(self) -> None:
        """Close everything; safe to call twice."""
        self._ports.close()

    def setup(self) -> None:
        """Start to measure how long the loop runs without a failure."""
        self._restarts = BackOff()
        self._opened_s = self.get_time_s()

    def loop(self) -> None:
        """Do one round; after a failure, open everything again first."""
        try:
            if self.is_shut:
                self._open()
                self.is_shut, self.next_tick_at_s, self._opened_s = False, None, self.get_time_s()
            self._round()
        except Exception as error:
            if not self.restarts:
                raise
            self._restart_later(error)

    def _restart_later(self, error: Exception) -> None:
        now_s = self.get_time_s()
        if not self.is_shut and now_s - self._opened_s >= STEADY_S:
            self._restarts.reset()
        self.failures += 1
        self.is_shut, self.next_tick_at_s = True, now_s + self._restarts.next_s()
        reason = printable_line(f"'{self.name}' failed and starts again: {error_text(error)}")
        if reason != self._failure:
            self.log.error("%s", reason, exc_info=error)
        self._failure = reason
        self.attempt(self._shut)
        self.attempt(partial(self._show_down, reason))

    def halt(self) -> None:
        """Send the goodbye message and close everything."""
        if not self.is_shut:
            self.attempt(self._drain_and_close)
        self.attempt(self._shut)

    def attempt(self, step: Callable[[], object]) -> None:
        """Do one step of closing; log what it raises, and the stack of the first failure only."""
        try:
            step()
        except Exception as error:
            if not self.restarts:
                raise
            stack = error if self.failures <= 1 else None
            self.log.error("'%s' could not close in order: %s", self.name, error_text(error), exc_info=stack)


def error_text(error: Exception) -> str:
    """Return an error's message: the system's text for its own errors, otherwise with the error's type.

    >>> error_text(KeyError("x"))
    "KeyError: 'x'"
    """
    return getattr(error, "strerror", None) or f"{type(error).__name__}: {error}".removesuffix(": ")
