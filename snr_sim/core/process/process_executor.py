"""A loop in a separate process, for heavy work that must not hold the node's interpreter lock: the node's side.

    node's thread                 MonitoredProcess's threads    the process (core/process/loop_process.py)
    begin, stop, join   ------->  writer: go, pages, end  ----->  a node without components, the loop on a thread
    inbox               <-------  listener: tasks, failures  <--  what the loop schedules

The process sends plain values (`prelude/values.py`), never pickled objects. The pages that the loop requests are sent
when they change: always the newest, so that old ones do not queue up for a slow loop; skipped ones are counted.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from snr_sim.core.datastore import PREVIOUS
from snr_sim.core.loop import Loop
from snr_sim.core.node_life import NodeLife
from snr_sim.core.process.factory_pickling import pickle_factory
from snr_sim.core.process.monitored_process import Message, MonitoredProcess
from snr_sim.core.profiler import Timing
from snr_sim.core.run_diagnostics import describe_unusable_page
from snr_sim.core.source_location import describe_error, without_addresses
from snr_sim.core.thread_executor import JOIN_TIMEOUT_S
from snr_sim.prelude.errors import ComponentFailedError, SnrError
from snr_sim.prelude.task import DataKey, Page, Task, TaskType

TARGET = "snr_sim.core.process.loop_process:run"
# Extra time for a process to end, compared with a thread: it waits for its own thread, halts the loop from outside if
# necessary, and reports it. SIGTERM would not do more than that, so a process that is later is killed.
_LONGER_S = 0.3


class ProcessExecutor:
    """Executor that calls a loop in a separate process. The node's own loop object only keeps the name."""

    setup_timeout_s: float = 3.0  # a process takes most of a second to start

    def __init__(self, loop: Loop, life: NodeLife) -> None:
        self._loop = loop
        self._life = life
        self._node = life.node
        self._child: MonitoredProcess | None = None
        self._changed: set[DataKey] = set()  # keys of pages to send
        self.skipped: int = 0  # pages that a newer one replaced before they were sent
        self._is_finished = False  # it has sent "over"
        self._has_setup_failed = False  # its setup failed while a caller waited: reported there, and the node continues
        self._late_failure: ComponentFailedError | None = None  # after its removal from the node: `join` raises it
        self._give_up_s: float | None = None
        self._store_listeners: list[tuple[DataKey, Callable[[Page], None]]] = []
        self.is_stopped: bool = False
        self.ticks: int = 0
        self.late_s: float = 0.0

    def start(self) -> None:
        """Start the process; it calls `setup` when it is ready."""
        loop, node = self._loop, self._node
        packed = pickle_factory(loop.factory, type(loop.factory).__name__, f"Loop '{loop.name}'")
        # The loop in the process has released its resources; this object has none.
        loop.__dict__["terminate"] = lambda: None
        order = {
            "factory": packed,
            "loop": loop.name,
            "role": node.role,
            "mode": node.mode.value,
            "seed": node.seed,
            "clock_start_s": time.monotonic() - node.clock.now_s(),
            "log_level": loop.log.getEffectiveLevel(),
            "is_setup_awaited": loop.setup_result is not None,
        }
        name = f"loop '{loop.name}'"
        self._child = MonitoredProcess(name, TARGET, order, self._on_message, self._on_end, packed["descriptors"])
        self._child.start()

    def wake(self) -> None:
        """Do nothing: pages are sent to the process anyway, and its next tick is when it is due."""

    def tick_now(self) -> None:
        """Do nothing: the page itself wakes the loop in its process."""

    def _send_page(self, key: DataKey) -> None:
        assert self._child is not None
        if key in self._changed:
            self.skipped += 1
            return

        def newest() -> Message:
            self._changed.discard(key)  # before the page is read: a newer one adds it again
            return "page", key, self._node.datastore.get(key)

        self._changed.add(key)
        self._child.send(newest)

    # The listener's thread

    def _on_end(self, status: int, error: Exception | None) -> None:
        assert self._child is not None
        self.is_stopped = True
        if error is not None:
            self._fail(describe_error(error, f"while the node read from the process of loop '{self._loop.name}'"))
        elif not self._is_finished and not self._child.is_killed:
            when = f" at t = {self._node.clock.now_s():.3f} s, after at least {self.ticks} ticks"
            message = self._child.exit_message(status, when, "It had printed nothing.")
            found = self._loop.on_death(message)
            if found is None or self._loop.is_removed or self._set_result(None):
                self._fail(message)
            else:
                self._node.enqueue_input(found, self._loop.name)

    def _on_message(self, kind: str, *values: Any) -> None:
        match kind, *values:
            case "task", type_name, name, val_list:
                self._node.enqueue_input(Task(TaskType(type_name), name, val_list), self._loop.name)
            case "counts", ticks, late_s, timings:
                self.ticks, self.late_s = ticks, late_s
                if self._node.profiler is not None:
                    self._node.profiler.timings.update({name: Timing(*timing) for name, timing in timings.items()})
            case "watch", key:
                self._watch(key)
            case "ask", what, *details:
                assert self._child is not None
                self._child.send(("answer", self._answer(what, *details)))
            case "log", name, level, text:
                logging.getLogger(name).log(level, "%s", text)
            case "note", text:
                self._node.add_note(text)
            case ("is set up",):
                self._set_result(None)
            case "failed", message:
                self._fail(message)
            case "unsendable", error, ["page", key, Page() as page]:
                self._drop_page(key, page, error)
            case "unsendable", error, _:
                self._fail(str(error))
            case ("stopped",):
                self.is_stopped = True
            case ("over",):
                self._is_finished = True

    def _answer(self, what: str, *details: Any) -> Any:
        """Return what the process asks: who stored a page that it refuses, or whether new code is blamed for that."""
        if what == "writer":
            return list(self._node.find_writer(details[0], self._loop.name))
        message, suspects, stored_at_s = details
        failure = ComponentFailedError(message, self._node.name, self._loop.name, "loop", suspects, stored_at_s)
        return self._life.blame_suspects(failure)

    def _watch(self, key: DataKey) -> None:
        """Send the newest page of a key now, and from now on each time one is stored."""

        def listener(_page: Page) -> None:
            self._send_page(key)

        for stored in {key, key.removesuffix(PREVIOUS)}:
            self._node.add_store_listener(stored, listener)
            self._store_listeners.append((stored, listener))
        self._send_page(key)

    def _drop_page(self, key: DataKey, page: Page, error: SnrError) -> None:
        """Leave out a page that cannot be sent if the code that stored it is rolled back for that; else fail."""
        assert self._child is not None
        what = without_addresses(error.message)
        text, suspects = describe_unusable_page(self._node, page, what, self._loop.name)
        message = f"{text}\n  Try: {error.fix}"
        ours = self._node.name, self._loop.name, "loop"
        if self._life.blame_suspects(ComponentFailedError(message, *ours, suspects, page.created_at_s)):
            self._child.send(("page", key, None))  # the loop may wait for its first
        else:
            self._fail(message)

    def _fail(self, message: str) -> None:
        failure = ComponentFailedError(message, self._node.name, self._loop.name)
        if self._set_result(failure):
            self._has_setup_failed = True
        elif self._has_setup_failed:
            self._node.add_note(failure.message)
        elif self._loop.is_removed:
            self._late_failure = self._late_failure or failure
        elif not self._life.handle_failure(self._loop, failure):
            self._node.inbox.fail(failure)

    def _set_result(self, failure: ComponentFailedError | None) -> bool:
        """Set the result of `setup`; return whether a caller was waiting for it."""
        return self._loop.setup_result is not None and self._loop.setup_result.set_result(failure)

    # The end

    def stop(self) -> None:
        """Ask for no more ticks."""
        self.is_stopped = True
        if self._give_up_s is None:
            self._give_up_s = time.monotonic() + JOIN_TIMEOUT_S + _LONGER_S
            if self._child is not None:
                self._child.end()

    def join(self) -> None:
        """Stop, and return once the process has ended; kill it if it is late. Raise a removed loop's failure."""
        self.stop()
        if self._child is None or self._give_up_s is None:
            return
        listener = self._child.listener
        with suppress(KeyboardInterrupt):  # a second Ctrl-C: end it now
            listener.join(max(self._give_up_s - time.monotonic(), 0.0))
        if listener.is_alive():
            self._child.kill()
            listener.join()
            self._node.add_note(
                f"The process of loop '{self._loop.name}' did not end within {JOIN_TIMEOUT_S + _LONGER_S:.1f} s and "
                "was killed; its halt() may not have been called."
            )
        while self._store_listeners:  # here and not in the listener: this thread iterates over the lists
            self._node.remove_store_listener(*self._store_listeners.pop())
        if self._late_failure is not None:
            raise self._late_failure
