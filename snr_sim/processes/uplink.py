"""Uplink: what one process publishes, subscribes to and logs; its pages go to the state manager.

Its methods may be called on any thread. On the node's thread what is published follows from the running handler, so a
replay compares it; elsewhere it is an input of the node.
"""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.errors import ConfigError, ParameterError, suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.task import Task
from snr_sim.prelude.text import one_line
from snr_sim.processes.message import EXTEND, PET, RESET, SUBSCRIPTIONS, TERMINATE, check_key, page_of

if TYPE_CHECKING:
    import numpy as np

LEVELS = ("CRITICAL", "ERROR", "WARNING", "INFO", "DEBUG", "NOTSET")
# A process reports that it works no more often than this: a loop of 50 Hz would send 50 pages a second.
PET_PERIOD_S = 0.1
LOG_NAME = "log.txt"


class Uplink:
    """The connection of one process to the state manager.

    Args:
        node: of the process.
        name: of the process.
        folder: for its log, created when it logs first; None writes no file.

    Attributes:
        keys: what it subscribes to, and whether it asks for the last value at each connect.
    """

    def __init__(self, node: NodeApi, name: str, folder: Path | None) -> None:
        self.name: str = name
        self.keys: dict[str, bool] = {}
        self.ever: set[str] = set()  # keys that it has subscribed to at any time
        self.is_connected: bool = False
        self.get_time_s: Callable[[], float] = node.get_time_s
        self._node = node
        self._folder = None if node.is_replay else folder
        self._pet_s = -math.inf

    @cached_property
    def rng(self) -> np.random.Generator:
        """The random generator of the process."""
        return rng_for(self._node.component_seed, self.name)

    def publish(self, key: str, value: Any) -> None:
        """Publish a value; see `RoverProcess.publish`."""
        check_key(self.name, "publishes", key, value)
        self._send(key, value, process_here=key in self.keys)

    def subscribe(self, key: str, with_last: bool) -> None:
        """Add a key to those whose messages arrive."""
        check_key(self.name, "subscribes to", key)
        self.keys[key] = with_last
        self.ever.add(key)
        self._report_keys([key] if with_last else [])

    def unsubscribe(self, key: str) -> None:
        """Remove a key; what is on its way does not arrive any more."""
        if key not in self.keys:
            raise ConfigError(f"{self.name} is not subscribed to {key!r}.", fix=suggest(str(key), self.keys))
        del self.keys[key]
        self._report_keys([])

    def connect(self, is_up: bool) -> None:
        """Note whether the broker is connected; a new connection begins with the whole list of subscriptions."""
        was_up, self.is_connected = self.is_connected, is_up
        if is_up and not was_up:
            self._report_keys([key for key, with_last in self.keys.items() if with_last])

    def _report_keys(self, last: list[str]) -> None:
        if self.is_connected:
            self._send(SUBSCRIPTIONS, {"keys": list(self.keys), "last": last})

    def pet(self, is_implicit: bool = False) -> None:
        """Report that the process works; by its loop, not more often than each `PET_PERIOD_S`."""
        now_s = self.get_time_s()
        if not is_implicit or now_s - self._pet_s >= PET_PERIOD_S:
            self._pet_s = now_s
            self._send(PET, None)

    def extend(self, timeout_s: float | Literal["PREVIOUS"]) -> None:
        """Set the time for which the process may be silent; see `RoverProcess.watchdog_extend`."""
        is_time = isinstance(timeout_s, (int, float)) and math.isfinite(timeout_s) and timeout_s > 0
        if not (is_time or timeout_s == "PREVIOUS"):
            raise ParameterError(
                f"{self.name} extends its watchdog by {timeout_s!r}.", fix='a number of seconds, or "PREVIOUS".'
            )
        self._send(EXTEND, timeout_s)

    def reset(self) -> None:
        """Reset the deadlines of all processes."""
        self._send(RESET, None)

    def terminate_state(self) -> None:
        """Ask the broker to end all processes."""
        self._send(TERMINATE, None)

    def _send(self, key: str, value: Any, process_here: bool = False) -> None:
        page = page_of(self.name, self._node, key, value, process_here)
        self._node.schedule(Task.store_page(page), self.name)

    def log(self, message: object, level: str) -> None:
        """Write a line to stderr, to the log and to the trace; see `RoverProcess.log`."""
        if level not in LEVELS:
            raise ConfigError(f"{self.name} logs at the level {level!r}.", fix=suggest(str(level), LEVELS))
        text = one_line(str(message), limit=2000)
        line = f"{self.name:<20}: {level:<8} {text}"
        if not self._node.is_replay:
            print_line(sys.stderr, line)
        if logging.getLevelName(level) >= logging.INFO:
            self._node.record_text(self.name, level, f"{text}\n")
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)
            with open(self._folder / LOG_NAME, "a", encoding="utf-8") as file:
                file.write(f"{line}\n")
