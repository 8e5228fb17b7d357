"""A loop in a process of its own: what runs inside the process. The node's side is `core/process/process_backing.py`.

Here is a node too: without components, with a door that leads to the real node, and a datastore that asks it. The loop
is called by a thread as any other loop is, so it cannot tell where it is.
"""

from __future__ import annotations

import logging
import os
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
from snr_sim.core.process.packing import unpack
from snr_sim.core.process.shared_arrays import SHARED, ArrayReceiver, ArraySender
from snr_sim.core.reload.trial import Trial
from snr_sim.prelude.errors import ComponentFailed, SnrError, ValueEncodingError
from snr_sim.prelude.page import KINDS, DataKey, Page
from snr_sim.prelude.task import Task
from snr_sim.prelude.values import decode_value, encode_value

_COUNTS_EVERY_S = 0.5
_OBJECT = b'{"$":"object"'  # in JSON text this is never part of a string, where the quotes would be escaped


def run(line: Connection) -> None:
    """Runs one loop until the node, or the node's death, ends it."""
    begin = decode_value(line.recv_bytes())[1]
    speaker = Speaker(line, ArraySender(begin["arrays"][0]), begin["loop"])
    pages = RemoteDatastore(speaker)
    life = Life()
    signal.signal(signal.SIGTERM, life.on_signal)
    spawned.hear_signals()
    receiver = ArrayReceiver(begin["arrays"][1])
    threading.Thread(target=listen, args=(line, speaker, receiver, pages, life), daemon=True).start()
    try:
        node = LoopNode(begin, speaker, pages)
        loop = make_loop(node, begin)
    except (Exception, SystemExit) as error:
        speaker.say("failed", describe_error(error, f"while loop '{begin['loop']}' was made in its process"))
        speaker.say("over")
        return
    backing = ProcessThread(loop, node.life, speaker)
    if begin["is_tried"]:
        loop.trial = LineTrial(speaker)
    speaker.say("ready")
    life.wait_until(life.may_go)
    if not life.is_ending.is_set():
        loop.begin_on(backing)
        life.wait_until(life.is_ending, lambda: send_counts(speaker, node, backing))
    finish(node, loop, backing, speaker)


def make_loop(node: Node, begin: dict[str, Any]) -> Loop:
    """Returns the loop, made anew in this process."""
    loop = unpack(begin["factory"]).get(node)
    assert isinstance(loop, Loop), f"{loop!r} is no loop, but was one in the node"
    return loop


def finish(node: Node, loop: Loop, backing: ProcessThread, speaker: Speaker) -> None:
    """Ends the loop as a node ends it, and says that all is over."""
    for step, function in (("halt", backing.join), ("terminate", loop.terminate)):
        try:
            function()
        except BaseException as error:
            node.door.fail(node.report.failure_of(loop, error, step))
    send_counts(speaker, node, backing)
    speaker.say("over")


def send_counts(speaker: Speaker, node: Node, backing: ProcessThread) -> None:
    """Tells how often the loop was called, how late, and what it took."""
    timings = {} if node.profiler is None else {name: astuple(one) for name, one in node.profiler.timings.items()}
    speaker.say("counts", backing.ticks, backing.late_s, {name: list(timing) for name, timing in timings.items()})


class Life:
    """When this process may go, and when it is to end."""

    def __init__(self) -> None:
        self.may_go = threading.Event()
        self.is_ending = threading.Event()

    def wait_until(self, event: threading.Event, now_and_then: Any = None) -> None:
        """Waits; looks up now and then, because a signal does not wake Python in the instant it falls asleep."""
        next_s = time.monotonic()
        while not event.wait(LOOK_UP_S) and not self.is_ending.is_set():
            if now_and_then is not None and time.monotonic() >= next_s:
                next_s = time.monotonic() + _COUNTS_EVERY_S
                now_and_then()

    def on_signal(self, number: int, frame: FrameType | None) -> None:
        """Somebody ends all processes of this robot at once: so does this one, in order."""
        threading.Thread(target=self.is_ending.set, daemon=True).start()  # no lock is taken in a signal's handler

    def on_orphaned(self) -> None:
        """The node's process is gone: nobody will end this one."""
        spawned.go_quiet()
        self.is_ending.set()
        time.sleep(2.0 * JOIN_TIMEOUT_S)
        os._exit(1)


def listen(line: Connection, speaker: Speaker, receiver: ArrayReceiver, pages: RemoteDatastore, life: Life) -> None:
    """Does what the node says, until it says nothing any more."""
    while True:
        try:
            raw = line.recv_bytes()
        except (EOFError, OSError):
            life.on_orphaned()
            return
        kind, *values = decode_value(raw, {**KINDS, SHARED: receiver.copy})
        if receiver.emptied:
            speaker.say("emptied", receiver.emptied)
            receiver.emptied = []
        if kind == "page":
            pages.arrived(*values)
        elif kind == "emptied":
            speaker.sender.take_back(values[0])
        elif kind == "go":
            life.may_go.set()
        elif kind == "stop":
            life.is_ending.set()


class Speaker:
    """Says things to the node, from any thread."""

    def __init__(self, line: Connection, sender: ArraySender, loop_name: str) -> None:
        self.sender = sender
        self._line = line
        self._loop_name = loop_name
        self._speaking = threading.Lock()

    def say(self, kind: str, *values: Any) -> None:
        """Sends plain values.

        Raises:
            ValueEncodingError: one is an object of a class that the node could not make anew.
        """
        raw = encode_value([kind, *(self.sender.share(value) for value in values)])
        if _OBJECT in raw:
            raise ValueEncodingError(
                f"Loop '{self._loop_name}' runs in a process of its own, and {_what(kind, values)} holds an object "
                f"that cannot leave it: {raw[raw.index(_OBJECT) :][:120].decode(errors='replace')}",
                fix="store numbers, text, lists, dicts and numpy arrays.",
            )
        with self._speaking:
            try:
                self._line.send_bytes(raw)
            except OSError:
                return  # the node is gone; `listen` has seen that, too


def _what(kind: str, values: tuple[Any, ...]) -> str:
    return f"{values[0]} '{values[1]}'" if kind == "task" else kind


class LineDoor(Door):
    """Leads to the real node's door."""

    def __init__(self, speaker: Speaker) -> None:
        super().__init__()
        self._speaker = speaker

    def put(self, task: Task, source: str) -> None:
        """Sends a task to the node."""
        self._speaker.say("task", task.type.value, task.name, task.val_list)

    def fail(self, failure: SnrError) -> None:
        """Tells the node what has failed here; the first one counts."""
        if self.failure is None:
            self.failure = failure
            self._speaker.say("failed", str(failure))


class LineTrial(Trial):
    """Tells the node's trial of this loop; whether somebody still waits there, only the node knows."""

    def __init__(self, speaker: Speaker) -> None:
        super().__init__()
        self._speaker = speaker

    def report(self, failure: ComponentFailed | None) -> bool:
        """Tells how `setup` went, or what failed after that; returns whether the node decides what comes of it."""
        if failure is None:
            self._speaker.say("is set up")
            return True
        self._speaker.say("failed", failure.message)
        return True


class RemoteDatastore(Datastore):
    """Has the pages that the loop has asked for once: from then on they come by themselves."""

    def __init__(self, speaker: Speaker) -> None:
        super().__init__()
        self._speaker = speaker
        self._asked: dict[DataKey, threading.Event] = {}

    def get(self, key: object) -> Page | None:
        """Returns the newest page of the key, or None; the first time it waits for the node's answer."""
        if not isinstance(key, str):
            return None  # no page is called so
        has_come = self._asked.get(key)
        if has_come is None:
            has_come = self._asked[key] = threading.Event()
            self._speaker.say("watch", key)
        if not has_come.is_set():
            has_come.wait()
        return self.pages.get(key)

    def arrived(self, key: DataKey, page: Page | None) -> None:
        """Takes what the node has sent."""
        if page is not None:
            self.pages[key] = page
        self._asked[key].set()


class LoopNode(Node):
    """The node as the loop in this process sees it."""

    def __init__(self, begin: dict[str, Any], speaker: Speaker, pages: RemoteDatastore) -> None:
        config = Config(Mode(begin["mode"]), {begin["role"]: []})
        super().__init__(begin["role"], config, clock=WallClock(begin["clock_start_s"]), seed=begin["seed"])
        self.door = LineDoor(speaker)
        self.datastore = pages
        self._speaker = speaker
        logger = logging.getLogger("snr")
        logger.handlers[:] = [LineHandler(speaker)]
        logger.setLevel(begin["log_level"])
        logger.propagate = False

    def note(self, text: str, lines: str = "") -> None:
        """Sends a remark to the node."""
        self._speaker.say("note", lines + text)


class LineHandler(logging.Handler):
    """Sends what is logged to the node, which knows who wants to read it."""

    def __init__(self, speaker: Speaker) -> None:
        super().__init__()
        self._speaker = speaker

    def emit(self, record: logging.LogRecord) -> None:
        """Sends one record."""
        try:
            line = self.format(record)
        except Exception:  # a log call that is wrong, or an object's own __str__
            self.handleError(record)
            return
        self._speaker.say("log", record.name, record.levelno, line)


class ProcessThread(ThreadBacking):
    """Calls the loop from a thread, and tells the node when no more ticks will come."""

    def __init__(self, loop: Loop, life: NodeLife, speaker: Speaker) -> None:
        super().__init__(loop, life)
        self._speaker = speaker

    def _run(self) -> None:
        super()._run()
        self._speaker.say("stopped")
