"""A loop in a process of its own: heavy work that leaves the node's interpreter lock alone. The node's side of it.

    node's thread                 keeper threads                      the process (core/process/loop_process.py)
    begin, stop, join   ------->  writer: go, pages, stop  ------->   a node without components, the loop on a thread
    the door            <-------  listener: tasks, failures  <-----   what the loop schedules

What comes back is plain values (`prelude/values.py`), never pickled objects. The pages that the loop asks for are sent
when they change: always the newest, so a slow loop does not have old ones pile up; those it misses are counted.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue
from typing import Any, TypeAlias

from snr_sim.core.backing import JOIN_TIMEOUT_S
from snr_sim.core.blame import describe_error
from snr_sim.core.component import CORE_NAME
from snr_sim.core.datastore import PREVIOUS
from snr_sim.core.loop import Loop
from snr_sim.core.node_core import NodeCore
from snr_sim.core.node_life import NodeLife
from snr_sim.core.process.packing import pack
from snr_sim.core.process.shared_arrays import SHARED, ArrayReceiver, ArraySender, make_shared_file
from snr_sim.core.process.spawn import Spawned, how_it_ended
from snr_sim.core.profiler import Timing
from snr_sim.prelude.errors import ComponentFailed
from snr_sim.prelude.page import KINDS, DataKey, Page
from snr_sim.prelude.task import Task, TaskType
from snr_sim.prelude.values import decode_value, encode_value

Tap: TypeAlias = Callable[[Page], None]

TARGET = "snr_sim.core.process.loop_process:run"
# How much longer than a thread a process may take to end: it waits for its thread itself, halts it from outside if need
# be, and has to say so. There is nothing that SIGTERM could add to that, so who is later is killed.
_LONGER_S = 0.3
_STOP: list[Any] = ["stop"]


class ProcessBacking:
    """Has a loop called in a process. What is left of the loop here is its name."""

    setup_patience_s = 3.0  # a process takes a good part of a second to be there at all

    def __init__(self, loop: Loop, life: NodeLife) -> None:
        self._loop = loop
        self._life = life
        self._node = life.node
        self._outbox: SimpleQueue[list[Any] | None] = SimpleQueue()
        self._changed: set[DataKey] = set()  # keys in the outbox
        self.skipped = 0  # pages that a newer one replaced before they were sent
        self._is_going = False
        self._is_killed = False
        self._is_finished = False  # it has said that all is over
        self._is_refused = False  # it failed in a trial: somebody has been told, and the node goes on
        self._late_failure: ComponentFailed | None = None  # since the node goes on without it: `join` tells
        self._give_up_s: float | None = None
        self._threads: list[threading.Thread] = []
        self._taps: list[tuple[list[Tap], Tap]] = []  # ours, and the lists they are in
        self.is_stopped = False
        self.ticks = 0
        self.late_s = 0.0

    def start(self) -> None:
        """Starts the process; it sets the loop up when it is ready."""
        loop, node = self._loop, self._node
        packed = pack(loop.factory, type(loop.factory).__name__, f"Loop '{loop.name}'")
        # What this object has to let go of, the process' own has let go of.
        loop.__dict__["terminate"] = _nothing
        arrays_out, arrays_in = make_shared_file(), make_shared_file()
        self._sender, self._receiver = ArraySender(arrays_out), ArrayReceiver(arrays_in)
        try:
            self._process = Spawned(TARGET, (arrays_out, arrays_in, *packed["descriptors"]))
        except BaseException:
            self._close()
            raise
        self._outbox.put(
            [
                "begin",
                {
                    "factory": packed,
                    "loop": loop.name,
                    "role": node.role,
                    "mode": node.mode.value,
                    "seed": node.seed,
                    "clock_start_s": time.monotonic() - node.clock.now_s(),
                    "log_level": loop.log.getEffectiveLevel(),
                    "arrays": [arrays_in, arrays_out],
                    "is_tried": loop.trial is not None,
                },
            ]
        )
        for run, name in ((self._listen, "listener"), (self._write, "writer")):
            self._threads.append(threading.Thread(target=run, name=f"{loop.name} {name}", daemon=True))
            self._threads[-1].start()

    def hurry(self) -> None:
        """Changes nothing: news is on its way to the process, and its tick there comes when it is due."""

    # The writer's thread: alone in saying anything, so that the listener never waits for a process that does not read.

    def _write(self) -> None:
        is_stopping = False
        while (message := self._outbox.get()) is not None:
            if message[0] == "go":
                if is_stopping:
                    continue
                self._is_going = True
            elif message is _STOP:
                is_stopping = True
                if not self._is_going:  # it has not set anything up, so there is nothing to wait for
                    self._kill()
                    continue
            elif message[0] == "page":
                key = message[1]
                self._changed.discard(key)  # before the page is read: a newer one asks again
                message = ["page", key, self._sender.share(self._node.datastore.get(key))]
            self._process.say(encode_value(message))

    def _kill(self) -> None:
        self._is_killed = True
        self._process.kill()

    def _tell_of(self, key: DataKey) -> None:
        if key in self._changed:
            self.skipped += 1
            return
        self._changed.add(key)
        self._outbox.put(["page", key])

    # The listener's thread

    def _listen(self) -> None:
        try:
            status = self._process.listen(self._hear)
        except Exception as error:
            self._fail(describe_error(error, f"while the node heard the process of loop '{self._loop.name}'"))
            self._kill()
            status = self._process.listen(_nothing)
        self.is_stopped = True
        if not self._is_finished and not self._is_killed:
            self._fail(self._obituary(status))
        self._outbox.put(None)
        self._threads[1].join()
        self._close()

    def _hear(self, raw: bytes) -> None:
        try:
            kind, *values = decode_value(raw, {**KINDS, SHARED: self._receiver.copy})
        finally:
            if self._receiver.emptied:
                self._outbox.put(["emptied", self._receiver.emptied])
                self._receiver.emptied = []
        if kind == "task":
            type_name, name, val_list = values
            self._node.enter(Task(TaskType(type_name), name, val_list), self._loop.name)
        elif kind == "counts":
            self._count(*values)
        elif kind == "ready":
            self._outbox.put(["go"])
        elif kind == "watch":
            self._watch(*values)
        elif kind == "emptied":
            self._sender.take_back(values[0])
        elif kind == "log":
            name, level, text = values
            logging.getLogger(name).log(level, "%s", text)
        elif kind == "note":
            self._node.note(values[0])
        elif kind == "is set up":
            self._tried(None)
        elif kind == "failed":
            self._fail(values[0])
        elif kind == "stopped":
            self.is_stopped = True
        elif kind == "over":
            self._is_finished = True

    def _count(self, ticks: int, late_s: float, timings: dict[str, list[Any]]) -> None:
        self.ticks, self.late_s = ticks, late_s
        if self._node.profiler is not None:
            self._node.profiler.timings.update({name: Timing(*timing) for name, timing in timings.items()})

    def _watch(self, key: DataKey) -> None:
        """Sends a page from now on whenever it is stored, and once at once."""

        def tap(page: Page) -> None:
            self._tell_of(key)

        for stored in {key, key.removesuffix(PREVIOUS)}:
            taps = self._core().taps.setdefault(stored, [])
            taps.append(tap)
            self._taps.append((taps, tap))
        self._tell_of(key)

    def _core(self) -> NodeCore:
        core = self._node.components[CORE_NAME]
        assert isinstance(core, NodeCore)
        return core

    def _fail(self, message: str) -> None:
        failure = ComponentFailed(message, self._node.name, self._loop.name)
        if self._tried(failure):
            self._is_refused = True
        elif self._is_refused:
            self._node.note(failure.message)
        elif self._loop.is_taken_out:
            self._late_failure = self._late_failure or failure
        elif not self._life.takes_failure(self._loop, failure):
            self._node.door.fail(failure)

    def _tried(self, failure: ComponentFailed | None) -> bool:
        """Tells whoever waits to hear what came of `setup`; returns whether somebody did."""
        return self._loop.trial is not None and self._loop.trial.report(failure)

    def _obituary(self, status: int) -> str:
        lines = "".join(f"\n    {line}" for line in self._process.last)
        return (
            f"The process of loop '{self._loop.name}' {how_it_ended(status)} at t = {self._node.clock.now_s():.3f} s, "
            f"after at least {self.ticks} ticks. " + (f"Its last lines:{lines}" if lines else "It had printed nothing.")
        )

    def _close(self) -> None:
        self._sender.close()
        self._receiver.close()

    # The end

    def stop(self) -> None:
        """Asks for no more ticks."""
        self.is_stopped = True
        if self._give_up_s is None:
            self._give_up_s = time.monotonic() + JOIN_TIMEOUT_S + _LONGER_S
            self._outbox.put(_STOP)

    def join(self) -> None:
        """Stops, and returns once the process has ended; one that does not is ended.

        Raises:
            ComponentFailed: the loop was taken out of its node, and failed after that.
        """
        self.stop()
        if not self._threads or self._give_up_s is None:
            return
        listener = self._threads[0]
        with suppress(KeyboardInterrupt):  # whoever is impatient wants it ended now
            listener.join(max(self._give_up_s - time.monotonic(), 0.0))
        if listener.is_alive():
            self._kill()
            listener.join()
            self._node.note(
                f"The process of loop '{self._loop.name}' did not end within {JOIN_TIMEOUT_S + _LONGER_S:.1f} s and "
                "was killed; its halt() may not have been called."
            )
        while self._taps:  # here and not in the listener: this is the thread that goes through the lists
            taps, tap = self._taps.pop()
            taps.remove(tap)
        if self._late_failure is not None:
            raise self._late_failure


def _nothing(*args: Any) -> None:
    """Stands where there is nothing to be done."""
