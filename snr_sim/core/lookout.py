"""Lookout: waits for descriptors and for a wake-up call at once. What a door waits with, once something is watched."""

from __future__ import annotations

import selectors
import socket
from collections.abc import Callable
from contextlib import suppress


class Lookout:
    """One thread waits; any may watch, unwatch and wake."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._near, self._far = socket.socketpair()
        self._near.setblocking(False)
        self._far.setblocking(False)
        self._selector.register(self._far, selectors.EVENT_READ, self._woken)

    def watch(self, descriptor: int, serve: Callable[[], None]) -> None:
        """Has `wait` return `serve` when the descriptor can be read."""
        self._selector.register(descriptor, selectors.EVENT_READ, serve)

    def unwatch(self, descriptor: int) -> None:
        """Ends that; before the descriptor is closed."""
        with suppress(KeyError):
            self._selector.unregister(descriptor)

    def wake(self) -> None:
        """Ends a wait; also from a signal handler."""
        with suppress(OSError):  # full is as good as written, and closed is over
            self._near.send(b"\0")

    def wait(self, timeout_s: float) -> list[Callable[[], None]]:
        """Waits until something can be read, somebody wakes it or time is over; returns whom to call."""
        return [key.data for key, _ in self._selector.select(timeout_s)]

    def close(self) -> None:
        """Lets go of the descriptors."""
        self._selector.close()
        self._near.close()
        self._far.close()

    def _woken(self) -> None:
        with suppress(OSError):
            self._far.recv(4096)
