"""A loop in a separate process: the code inside that process. The node's side is `core/process/process_executor.py`.

The process has a proxy node: without components, with an inbox that sends to the real node, and a datastore that
requests pages from it. A thread calls the loop like any other loop, so its code is the same in both places.
"""

from __future__ import annotations

import logging
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import astuple
from multiprocessing.connection import Connection
from queue import Empty
from types import FrameType
from typing import Any

from snr_sim.core.clocks import WallClock
from snr_sim.core.config import Config, Mode
from snr_sim.core.datastore import Datastore
from snr_sim.core.inbox import POLL_PERIOD_S, Inbox
from snr_sim.core.loop import Loop, SetupResult
from snr_sim.core.node import Node
from snr_sim.core.node_life import NodeLife
from snr_sim.core.process import spawned
from snr_sim.core.process.factory_pickling import unpickle_factory
from snr_sim.core.process.messages import MessageLine
from snr_sim.core.source_location import describe_error
from snr_sim.core.thread_executor import JOIN_TIMEOUT_S, ThreadExecutor
from snr_sim.prelude.errors import ComponentFailedError, SnrError
from snr_sim.prelude.task import DataKey, Page, Task, TaskType
from snr_sim.prelude.waiting import TimedQueue

_COUNTS_PERIOD_S = 0.5
_ANSWER_TIMEOUT_S = 1.0  # a node that ends does not answer


def run(line: Connection) -> None:
    """Run one loop until the node ends it or the node's process has ended."""
    messages = MessageLine(line)
    begin = messages.receive()[1]
    messages.user = f"Loop '{begin['loop']}'"
    pages = RemoteDatastore(messages)
    answers: TimedQueue[Any] = TimedQueue()
    life = ProcessLifetime()
    signal.signal(signal.SIGTERM, life.on_signal)
    spawned.unblock_signals()

    def handle(kind: str, *values: Any) -> None:
        if kind == "page":
            pages.on_page(*values)
        elif kind == "answer":
            answers.put(values[0])
        elif kind == "go":
            life.may_go.set()

    orders = (messages.receive, life.end, handle, 2.0 * JOIN_TIMEOUT_S)
    threading.Thread(target=spawned.execute_messages, args=orders, daemon=True).start()
    try:
        node = LoopNode(begin, messages, pages, answers)
        loop = unpickle_factory(begin["factory"]).get(node)
        assert isinstance(loop, Loop), f"{loop!r} is not a Loop, but the node's factory returned one"
    except (Exception, SystemExit) as error:
        messages.send("failed", describe_error(error, f"while loop '{begin['loop']}' was made in its process"))
        messages.send("over")
        return
    executor = ProcessThread(loop, node.life, messages)
    if begin["is_setup_awaited"]:
        loop.setup_result = RemoteSetupResult(messages)
    messages.send("ready")
    life.wait_until(life.may_go)
    if not life.is_ending.is_set():
        for key in loop.wakes_on:
            pages.request(key, executor.tick_now)
        loop.begin_with(executor)
        life.wait_until(life.is_ending, lambda: send_counts(messages, node, executor))
    finish(node, loop, executor, messages)


def finish(node: Node, loop: Loop, executor: ProcessThread, messages: MessageLine) -> None:
    """End the loop as a node ends it, and send "over"."""
    for step, function in (("halt", executor.join), ("terminate", loop.terminate)):
        try:
            function()
        except BaseException as error:
            node.inbox.fail(node.report.failure_of(loop, error, step))
    send_counts(messages, node, executor)
    messages.send("over")


def send_counts(messages: MessageLine, node: Node, executor: ProcessThread) -> None:
    """Send the loop's number of ticks, largest delay and timings."""
    timings = {} if node.profiler is None else {name: list(astuple(one)) for name, one in node.profiler.timings.items()}
    messages.send("counts", executor.ticks, executor.late_s, timings)


class ProcessLifetime:
    """Lifetime of this process: events for its start and its end."""

    def __init__(self) -> None:
        self.may_go: threading.Event = threading.Event()
        self.is_ending: threading.Event = threading.Event()

    def wait_until(self, event: threading.Event, periodic: Any = None) -> None:
        """Wait in short steps, since a signal that arrives just before the blocking call does not end it."""
        next_s = time.monotonic()
        while not event.wait(POLL_PERIOD_S) and not self.is_ending.is_set():
            if periodic is not None and time.monotonic() >= next_s:
                next_s = time.monotonic() + _COUNTS_PERIOD_S
                periodic()

    def on_signal(self, number: int, frame: FrameType | None) -> None:
        """Shut down gracefully: the signal went to all processes of this robot at once."""
        threading.Thread(target=self.end, daemon=True).start()  # a signal handler must not take locks

    def end(self, reason: str = "") -> None:
        """Shut the loop down gracefully."""
        self.is_ending.set()


class RemoteInbox(Inbox):
    """Proxy of the real node's inbox."""

    failure: SnrError | None

    def __init__(self, messages: MessageLine, pages: RemoteDatastore) -> None:
        super().__init__()
        self._messages = messages
        self._pages = pages.pages

    def put(self, task: Task, source: str) -> None:
        """Send a task to the node; a page is here until the node has sent one of its key."""
        self._messages.send("task", task.type.value, task.name, task.val_list)
        if task.type is TaskType.store_page and task.page is not None:
            self._pages.setdefault(task.page.key, task.page)

    def fail(self, failure: SnrError) -> None:
        """Send a failure in this process to the node; the first one is kept."""
        if self.failure is None:
            self.failure = failure
            self._messages.send("failed", str(failure))


class RemoteSetupResult(SetupResult):
    """Proxy of the node's result of `setup`; only the node knows whether a caller still waits for it."""

    def __init__(self, messages: MessageLine) -> None:
        super().__init__()
        self._messages = messages

    def set_result(self, failure: ComponentFailedError | None) -> bool:
        """Send the result of `setup`, or a later failure; return whether the node handles the failure."""
        self._messages.send(*(("is set up",) if failure is None else ("failed", failure.message)))
        return True


class RemoteDatastore(Datastore):
    """Proxy of the node's datastore. A page is requested once; from then on the node sends each new one."""

    def __init__(self, messages: MessageLine) -> None:
        super().__init__()
        self._messages = messages
        self._requests: dict[DataKey, threading.Event] = {}
        self._wakes: dict[DataKey, Callable[[], None]] = {}

    def request(self, key: DataKey, wake: Callable[[], None]) -> None:
        """Request each page of a key, and call `wake` when one has arrived."""
        self._wakes[key] = wake
        self._watch(key)

    def _watch(self, key: DataKey) -> threading.Event:
        has_arrived = self._requests.get(key)
        if has_arrived is None:
            has_arrived = self._requests[key] = threading.Event()
            self._messages.send("watch", key)
        return has_arrived

    def get(self, key: object) -> Page | None:
        """Return the newest page of the key, or None; the first call waits for the node's reply."""
        if not isinstance(key, str):
            return None  # not a valid key
        has_arrived = self._watch(key)
        if not has_arrived.is_set():
            has_arrived.wait()
        return self.pages.get(key)

    def on_page(self, key: DataKey, page: Page | None) -> None:
        """Store a page that the node has sent."""
        if page is not None:
            self.pages[key] = page
        self._requests[key].set()
        if page is not None and key in self._wakes:
            self._wakes[key]()


class LoopNode(Node):
    """The node as the loop in this process sees it. What only the node itself knows, the loop's thread asks it."""

    def __init__(
        self, begin: dict[str, Any], messages: MessageLine, pages: RemoteDatastore, answers: TimedQueue[Any]
    ) -> None:
        config = Config(Mode(begin["mode"]), {begin["role"]: []})
        super().__init__(begin["role"], config, clock=WallClock(begin["clock_start_s"]), seed=begin["seed"])
        self.inbox: RemoteInbox = RemoteInbox(messages, pages)
        self.datastore: RemoteDatastore = pages
        self._messages = messages
        self._answers = answers
        self.life.blame_suspects = self._blame_suspects
        logger = logging.getLogger("snr")
        logger.handlers[:] = [RemoteLogHandler(messages)]
        logger.setLevel(begin["log_level"])
        logger.propagate = False

    def add_note(self, text: str, lines: str = "", *, is_recorded: bool = True) -> None:
        """Send a note to the node."""
        self._messages.send("note", lines + text)

    def find_writer(self, key: DataKey, reader: str) -> tuple[str, str, tuple[str, ...]]:
        """Ask the node, which has the components."""
        lines, who, suspects = self._ask("writer", key) or ("", "another process", ())
        return lines, who, tuple(suspects)

    def _blame_suspects(self, failure: ComponentFailedError) -> bool:
        return bool(self._ask("blame", failure.message, list(failure.suspects), failure.stored_at_s))

    def _ask(self, *question: Any) -> Any:
        self._messages.send("ask", *question)
        with suppress(Empty):
            return self._answers.get(_ANSWER_TIMEOUT_S)


class RemoteLogHandler(logging.Handler):
    """Log handler that sends records to the node, whose logging settings apply."""

    def __init__(self, messages: MessageLine) -> None:
        super().__init__()
        self._messages = messages

    def emit(self, record: logging.LogRecord) -> None:
        """Send one record."""
        try:
            line = self.format(record)
        except Exception:  # a log call that is wrong, or an object's own __str__
            self.handleError(record)
            return
        self._messages.send("log", record.name, record.levelno, line)


class ProcessThread(ThreadExecutor):
    """Executor that calls the loop from a thread, and notifies the node when no more ticks will follow."""

    def __init__(self, loop: Loop, life: NodeLife, messages: MessageLine) -> None:
        super().__init__(loop, life)
        self._messages = messages

    def _run(self) -> None:
        super()._run()
        self._messages.send("stopped")
