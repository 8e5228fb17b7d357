"""A loop that brings a list of values, one at each tick: the input of a test."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.node import Node
from snr_sim.prelude import tasks
from snr_sim.prelude.page import DataKey

ALL_REPLAYED = "list replayed"


class ListReplayerFactory(LoopFactory):
    """Stores values under a key, one at each tick, then stops.

    Args:
        values: in order.
        key: of the pages.
        exit_when_done: ends the node one tick after the last value, when all has been made of it.
        rate_hz: ticks per second.
    """

    def __init__(
        self, values: Iterable[Any], key: DataKey, exit_when_done: bool = False, rate_hz: float = 100.0
    ) -> None:
        super().__init__()
        self.values = list(values)
        self.key = key
        self.exit_when_done = exit_when_done
        self.rate_hz = rate_hz

    def get(self, parent: Node) -> ListReplayer:
        """Returns the loop `<key>_replayer`."""
        return ListReplayer(self, parent, f"{self.key}_replayer", self.rate_hz)


class ListReplayer(Loop):
    """Brings the factory's values."""

    factory: ListReplayerFactory

    def setup(self) -> None:
        """Starts at the first value."""
        self._left = iter(self.factory.values)

    def loop(self) -> None:
        """Stores the next value."""
        for value in self._left:
            self.store_data(self.factory.key, value)
            return
        if self.factory.exit_when_done:
            self.schedule(tasks.terminate(ALL_REPLAYED))
        self.stop()
