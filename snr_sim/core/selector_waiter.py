"""Selector-based wait for descriptors and a wake-up. An inbox uses it once a descriptor is watched."""

from __future__ import annotations

import selectors
import socket
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeAlias

Call: TypeAlias = tuple[Callable[[list[Any]], None], list[Any]]  # what to call, and with what


class SelectorWaiter:
    """Wait for descriptors: one thread waits; any thread may watch, unwatch and wake."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._near, self._far = socket.socketpair()
        self._near.setblocking(False)
        self._far.setblocking(False)
        self._selector.register(self._far, selectors.EVENT_READ, (self._woken, None))

    def watch(self, descriptor: int, serve: Callable[[list[Any]], None], what: Any) -> None:
        """Register a descriptor: `wait` returns `serve` and `what` when it is readable."""
        self._selector.register(descriptor, selectors.EVENT_READ, (serve, what))

    def unwatch(self, descriptor: int) -> None:
        """Unregister a descriptor; call it before the descriptor is closed."""
        with suppress(KeyError):
            self._selector.unregister(descriptor)

    def wake(self) -> None:
        """End a wait; also from a signal handler."""
        with suppress(OSError):  # a full buffer wakes the waiter as well; a closed one has none
            self._near.send(b"\0")

    def wait(self, timeout_s: float) -> Sequence[Call]:
        """Wait for a readable descriptor, a wake-up or the timeout; return the functions to call, with their lists."""
        events = self._selector.select(timeout_s)
        if len(events) == 1:  # the usual case
            serve, what = events[0][0].data
            return [(serve, [what])]
        calls: dict[Callable[[list[Any]], None], list[Any]] = {}
        for key, _ in events:
            serve, what = key.data
            calls.setdefault(serve, []).append(what)
        return list(calls.items())

    def close(self) -> None:
        """Close the descriptors."""
        self._selector.close()
        self._near.close()
        self._far.close()

    def _woken(self, what: list[Any]) -> None:
        with suppress(OSError):
            self._far.recv(4096)
