"""A loop in a separate process: the code inside that process. The node's side is `core/process/process_backing.py`.

The process has a proxy node: without components, with an inbox that sends to the real node, and a datastore that
requests pages from it. A thread calls the loop like any other loop, so its code is the same in both places.
"""

from __future__ import annotations

import logging
import signal
import threading
import time
from dataclasses import astuple
from multiprocessing.connection import Connection
from types import FrameType
from typing import Any

from snr_sim.core.backing import JOIN_TIMEOUT_S, ThreadBacking
from snr_sim.core.blame import describe_error
from snr_sim.core.clocks import WallClock
from snr_sim.core.config import Config, Mode
from snr_sim.core.datastore import Datastore
from snr_sim.core.door import LOOK_UP_S, Door
from snr_sim.core.loop import Loop
from snr_sim.core.node import Node
from snr_sim.core.node_life import NodeLife
from snr_sim.core.process import spawned
from snr_sim.core.process.messages import MessageLine
from snr_sim.core.process.packing import unpack
from snr_sim.core.reload.trial import Trial
from snr_sim.prelude.errors import ComponentFailed, SnrError
from snr_sim.prelude.page import DataKey, Page
from snr_sim.prelude.task import Task

_COUNTS_EVERY_S = 0.5


def run(line: Connection) -> None:
    """Run one loop until the node ends it or the node's process has ended."""
    messages = MessageLine(line)
    begin = messages.receive()[1]
    messages.user = f"Loop '{begin['loop']}'"
    pages = RemoteDatastore(messages)
    life = Life()
    signal.signal(signal.SIGTERM, life.on_signal)
    spawned.hear_signals()

    def handle(kind: str, *values: Any) -> None:
        if kind == "page":
            pages.arrived(*values)
        elif kind == "go":
            life.may_go.set()

    orders = (messages.receive, life.end, handle, 2.0 * JOIN_TIMEOUT_S)
    threading.Thread(target=spawned.obey, args=orders, daemon=True).start()
    try:
        node = LoopNode(begin, messages, pages)
        loop = make_loop(node, begin)
    except (Exception, SystemExit) as error:
        messages.send("failed", describe_error(error, f"while loop '{begin['loop']}' was made in its process"))
        messages.send("over")
        return
    backing = ProcessThread(loop, node.life, messages)
    if begin["is_tried"]:
        loop.trial = LineTrial(messages)
    messages.send("ready")
    life.wait_until(life.may_go)
    if not life.is_ending.is_set():
        loop.begin_on(backing)
        life.wait_until(life.is_ending, lambda: send_counts(messages, node, backing))
    finish(node, loop, backing, messages)


def make_loop(node: Node, begin: dict[str, Any]) -> Loop:
    """Return the loop, created again in this process."""
    loop = unpack(begin["factory"]).get(node)
    assert isinstance(loop, Loop), f"{loop!r} is no loop, but was one in the node"
    return loop


def finish(node: Node, loop: Loop, backing: ProcessThread, messages: MessageLine) -> None:
    """End the loop as a node ends it, and send "over"."""
    for step, function in (("halt", backing.join), ("terminate", loop.terminate)):
        try:
            function()
        except BaseException as error:
            node.door.fail(node.report.failure_of(loop, error, step))
    send_counts(messages, node, backing)
    messages.send("over")


def send_counts(messages: MessageLine, node: Node, backing: ProcessThread) -> None:
    """Send the loop's number of ticks, largest delay and timings."""
    timings = {} if node.profiler is None else {name: astuple(one) for name, one in node.profiler.timings.items()}
    messages.send("counts", backing.ticks, backing.late_s, {name: list(timing) for name, timing in timings.items()})


class Life:
    """Lifetime of this process: events for its start and its end."""

    def __init__(self) -> None:
        self.may_go = threading.Event()
        self.is_ending = threading.Event()

    def wait_until(self, event: threading.Event, now_and_then: Any = None) -> None:
        """Wait in short steps, since a signal that arrives just before the blocking call does not end it."""
        next_s = time.monotonic()
        while not event.wait(LOOK_UP_S) and not self.is_ending.is_set():
            if now_and_then is not None and time.monotonic() >= next_s:
                next_s = time.monotonic() + _COUNTS_EVERY_S
                now_and_then()

    def on_signal(self, number: int, frame: FrameType | None) -> None:
        """Shut down gracefully: the signal went to all processes of this robot at once."""
        threading.Thread(target=self.end, daemon=True).start()  # a signal handler must not take locks

    def end(self, why: str = "") -> None:
        """Shut the loop down gracefully."""
        self.is_ending.set()


class LineDoor(Door):
    """Proxy of the real node's inbox (`Door`)."""

    def __init__(self, messages: MessageLine) -> None:
        super().__init__()
        self._messages = messages

    def put(self, task: Task, source: str) -> None:
        """Send a task to the node."""
        self._messages.send("task", task.type.value, task.name, task.val_list)

    def fail(self, failure: SnrError) -> None:
        """Send a failure in this process to the node; the first one is kept."""
        if self.failure is None:
            self.failure = failure
            self._messages.send("failed", str(failure))


class LineTrial(Trial):
    """Proxy of the node's trial of this loop; only the node knows whether a caller still waits for the result."""

    def __init__(self, messages: MessageLine) -> None:
        super().__init__()
        self._messages = messages

    def report(self, failure: ComponentFailed | None) -> bool:
        """Send the result of `setup`, or a later failure; return whether the node handles the failure."""
        self._messages.send(*(("is set up",) if failure is None else ("failed", failure.message)))
        return True


class RemoteDatastore(Datastore):
    """Proxy of the node's datastore. A page is requested once; from then on the node sends each new one."""

    def __init__(self, messages: MessageLine) -> None:
        super().__init__()
        self._messages = messages
        self._asked: dict[DataKey, threading.Event] = {}

    def get(self, key: object) -> Page | None:
        """Return the newest page of the key, or None; the first call waits for the node's reply."""
        if not isinstance(key, str):
            return None  # not a valid key
        has_come = self._asked.get(key)
        if has_come is None:
            has_come = self._asked[key] = threading.Event()
            self._messages.send("watch", key)
        if not has_come.is_set():
            has_come.wait()
        return self.pages.get(key)

    def arrived(self, key: DataKey, page: Page | None) -> None:
        """Store a page that the node has sent."""
        if page is not None:
            self.pages[key] = page
        self._asked[key].set()


class LoopNode(Node):
    """The node as the loop in this process sees it."""

    def __init__(self, begin: dict[str, Any], messages: MessageLine, pages: RemoteDatastore) -> None:
        config = Config(Mode(begin["mode"]), {begin["role"]: []})
        super().__init__(begin["role"], config, clock=WallClock(begin["clock_start_s"]), seed=begin["seed"])
        self.door = LineDoor(messages)
        self.datastore = pages
        self._messages = messages
        logger = logging.getLogger("snr")
        logger.handlers[:] = [LineHandler(messages)]
        logger.setLevel(begin["log_level"])
        logger.propagate = False

    def note(self, text: str, lines: str = "") -> None:
        """Send a note to the node."""
        self._messages.send("note", lines + text)


class LineHandler(logging.Handler):
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


class ProcessThread(ThreadBacking):
    """Executor that calls the loop from a thread, and notifies the node when no more ticks will follow."""

    def __init__(self, loop: Loop, life: NodeLife, messages: MessageLine) -> None:
        super().__init__(loop, life)
        self._messages = messages

    def _run(self) -> None:
        super()._run()
        self._messages.send("stopped")
