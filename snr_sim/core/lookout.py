"""Lookout: waits for descriptors and for a wake-up call at once. What a door waits with, once something is watched."""

from __future__ import annotations

import selectors
import socket
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeAlias

Call: TypeAlias = tuple[Callable[[list[Any]], None], list[Any]]  # what to call, and with what


class Lookout:
    """One thread waits; any may watch, unwatch and wake."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._near, self._far = socket.socketpair()
        self._near.setblocking(False)
        self._far.setblocking(False)
        self._selector.register(self._far, selectors.EVENT_READ, (self._woken, None))

    def watch(self, descriptor: int, serve: Callable[[list[Any]], None], what: Any) -> None:
        """Have `wait` return `serve` and `what` when the descriptor can be read."""
        self._selector.register(descriptor, selectors.EVENT_READ, (serve, what))

    def unwatch(self, descriptor: int) -> None:
        """End that; before the descriptor is closed."""
        with suppress(KeyError):
            self._selector.unregister(descriptor)

    def wake(self) -> None:
        """End a wait; also from a signal handler."""
        with suppress(OSError):  # full is as good as written, and closed is over
            self._near.send(b"\0")

    def wait(self, timeout_s: float) -> Sequence[Call]:
        """Wait for something to read, a wake-up call or the timeout; return what to call, each with all that is its."""
        events = self._selector.select(timeout_s)
        if len(events) == 1:  # as nearly always
            serve, what = events[0][0].data
            return [(serve, [what])]
        calls: dict[Callable[[list[Any]], None], list[Any]] = {}
        for key, _ in events:
            serve, what = key.data
            calls.setdefault(serve, []).append(what)
        return list(calls.items())

    def close(self) -> None:
        """Let go of the descriptors."""
        self._selector.close()
        self._near.close()
        self._far.close()

    def _woken(self, what: list[Any]) -> None:
        with suppress(OSError):
            self._far.recv(4096)
