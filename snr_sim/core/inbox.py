"""Inbox of a node: a thread-safe queue that fixes the order of all input from outside."""

from __future__ import annotations

import selectors
import socket
import threading
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeAlias

from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.task import Task, TaskType
from snr_sim.prelude.waiting import WakeUp

# A signal that arrives just before the blocking call does not interrupt it (2 of 300 interrupted nodes hung), so every
# wait ends after this time at the latest and the caller checks for signals.
POLL_PERIOD_S = 0.2
Call: TypeAlias = tuple[Callable[[list[Any]], None], list[Any]]  # what to call, and with what


class SelectorWaiter:
    """Wait for descriptors and a wake-up, once a descriptor is watched. One thread waits; any may call the rest."""

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


class Inbox:
    """Queue that any thread can put into and one thread takes from; a wait costs no CPU time.

    `deque.append` and `WakeUp.wake` are atomic for threads and signal handlers. So `put` holds no lock that an
    interrupt could leave locked, which would make a node hang at Ctrl-C.
    """

    def __init__(self) -> None:
        self.waiting: deque[tuple[Task, str]] = deque()
        self.failure: SnrError | None = None
        self._wake_up = WakeUp()
        self.is_waiting: bool = False  # whether the node's thread is in `wait` now
        self._selector_waiter: SelectorWaiter | None = None
        self._opening = threading.Lock()  # to create the waiter; only links' threads take it
        self.wait_count: int = 0  # how many times the node has called `wait`

    def watch(self, descriptor: int, serve: Callable[[list[Any]], None], what: Any) -> None:
        """Call `serve` on the node's thread when a descriptor is readable, while the node waits in `wait`.

        One call gets the `what` of all readable descriptors with this `serve`, which decides the order.
        An idle node then receives input without a thread switch. A busy node does not call `wait`, so the caller needs
        another way to read as well.
        """
        with self._opening:  # two links may start at the same time, each on its own thread
            if self._selector_waiter is None:
                self._selector_waiter = SelectorWaiter()
                self._wake_up.wake()  # ends a wait that has already begun on this queue
        self._selector_waiter.watch(descriptor, serve, what)

    def unwatch(self, descriptor: int) -> None:
        """Stop watching a descriptor; from any thread."""
        if self._selector_waiter is not None:
            self._selector_waiter.unwatch(descriptor)

    def close(self) -> None:
        """Close the descriptors used for waiting; call it only after the last `wait`."""
        if self._selector_waiter is not None:
            self._selector_waiter.close()

    def put(self, task: Task, source: str) -> None:
        """Add a task, and wake the node if it waits; `source` names the loop, link or client that sent it."""
        self.waiting.append((task, source))
        if self.is_waiting:
            self.is_waiting = False  # one wake-up is enough for all tasks put before the node takes them
            if self._selector_waiter is None:
                self._wake_up.wake()
            else:
                self._selector_waiter.wake()

    def drop(self, source: str) -> None:
        """Drop the waiting tasks of one sender, on the node's thread."""
        for _ in range(len(self.waiting)):
            one = self.waiting.popleft()
            if one[1] != source:
                self.waiting.append(one)

    def fail(self, failure: SnrError) -> None:
        """Report a failure outside the node's thread; the first one is kept."""
        if self.failure is None:
            self.failure = failure
        self.put(Task(TaskType.terminate, "failure"), "failure")  # so that a busy node checks its inbox

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait until a task is in the inbox or the timeout is over; may also return earlier."""
        timeout_s = POLL_PERIOD_S if timeout_s is None else min(timeout_s, POLL_PERIOD_S)
        self.wait_count += 1
        selector_waiter = self._selector_waiter
        seen: Sequence[Call] = ()
        self.is_waiting = True  # before the last check, so that a `put` after the check wakes this thread
        try:
            if not self.waiting:
                if selector_waiter is None:
                    self._wake_up.wait(timeout_s)
                else:
                    seen = selector_waiter.wait(timeout_s)
        finally:
            self.is_waiting = False
        for serve, what in seen:
            serve(what)
