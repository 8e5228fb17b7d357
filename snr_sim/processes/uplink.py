"""Uplink: the connection of one process to its node and to the state manager.

Its methods may be called on any thread. On the node's thread what is published follows from the running handler, so a
replay compares it; elsewhere it is an input of the node.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import Task
from snr_sim.processes.message import EXTEND, PET, SUBSCRIPTIONS, page_of
from snr_sim.supervision.watch import PREVIOUS

# A process reports that it works no more often than this: a loop of 50 Hz would send 50 pages a second.
PET_PERIOD_S = 0.1
LOG_NAME = "log.txt"


class Uplink:
    """What a process sends.

    Args:
        node: of the process.
        name: of the process.
        folder: of its log, made when it logs first; None writes none.
        spawn: calls a function, with these arguments, in addition to the loop.

    Attributes:
        keys: what it subscribes to, and whether it asks for the last value at each connection.
        ever: what it has subscribed to at any time.
    """

    def __init__(self, node: NodeApi, name: str, folder: Path | None, spawn: Callable[..., None]) -> None:
        self.node: NodeApi = node
        self.name: str = name
        self.spawn: Callable[..., None] = spawn
        self.keys: dict[str, bool] = {}
        self.ever: set[str] = set()
        self._folder = folder
        self._is_connected = False
        self._pet_s = -math.inf
        self._timeouts_s: list[float] = []

    def send(self, key: str, value: Any) -> None:
        """Publish a value under any key; raise a ValueEncodingError if it cannot be sent."""
        page = page_of(self.name, self.node, key, value, process_here=key in self.keys)
        self.node.schedule(Task.store_page(page), self.name)

    def pet(self) -> None:
        """Report that the process works, if it has not done so within `PET_PERIOD_S`."""
        now_s = self.node.get_time_s()
        if now_s - self._pet_s >= PET_PERIOD_S:
            self._pet_s = now_s
            self.send(PET, None)

    def extend(self, timeout_s: float | Literal["PREVIOUS"]) -> None:
        """Set the time for which the process may be silent [s]; "PREVIOUS" sets the one before."""
        if timeout_s != PREVIOUS:
            self._timeouts_s = [*self._timeouts_s[-1:], float(timeout_s)]
        else:
            self._timeouts_s = self._timeouts_s[:-1] * 2  # as of `Watch.extend`
        self.send(EXTEND, timeout_s)

    def connect(self, is_up: bool) -> None:
        """Note whether the broker is connected; a new connection begins with all that a new broker does not know."""
        was_up, self._is_connected = self._is_connected, is_up
        if is_up and not was_up:
            self.report_keys([key for key, with_last in self.keys.items() if with_last], self._timeouts_s)

    def report_keys(self, last: list[str], timeouts_s: list[float] | None = None) -> None:
        """Send the list of subscriptions, unless `connect` does it later; `last` are those whose last value to send."""
        if self._is_connected:
            self.send(SUBSCRIPTIONS, {"keys": list(self.keys), "last": last, "timeouts_s": timeouts_s})

    def log(self, level: str, text: str) -> None:
        """Write a line to stderr and to the log, and the text into the trace; a replay does none of it."""
        if self.node.is_replay:
            return
        line = f"{self.name:<20}: {level:<8} {text}"
        print_line(sys.stderr, line)
        if level not in ("DEBUG", "NOTSET"):
            self.node.record_text(self.name, level, f"{text}\n")
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)
            with open(self._folder / LOG_NAME, "a", encoding="utf-8") as file:
                file.write(f"{line}\n")
