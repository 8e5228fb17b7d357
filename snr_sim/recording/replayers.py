"""Replayers: loops that store the content of a list, a text file, a recording or a trace.

A replayer that should end the run does so once all its pages, and the tasks that follow from them, are processed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey, Page, Task
from snr_sim.recording.page_reader import PageReader, TextReader

ALL_REPLAYED = "replayed"


class ListReplayerFactory(LoopFactory):
    """Factory of a loop that stores values under a key, one at each tick, then stops.

    Args:
        exit_when_done: whether to end the node once the last value is fully processed.
        rate_hz: ticks per second.

    Raises:
        ConfigError: the key is not a string.
    """

    def __init__(
        self, values: Iterable[Any], key: DataKey, exit_when_done: bool = False, rate_hz: float = 1000.0
    ) -> None:
        super().__init__()
        if not isinstance(key, str):
            raise ConfigError(
                f"ListReplayerFactory stores under the key {key!r}, which is not text.",
                fix="the values first, then their key: ListReplayerFactory([1, 2], 'depth').",
            )
        self.values: list[Any] = list(values)
        self.key: DataKey = key
        self.exit_when_done: bool = exit_when_done
        self.rate_hz: float = rate_hz

    def get(self, parent: NodeApi) -> ListReplayer:
        """Return the loop `<key>_replayer`."""
        return ListReplayer(self, parent, f"{self.key}_replayer", self.rate_hz)


class ListReplayer(Loop):
    """Stores the factory's values."""

    factory: ListReplayerFactory

    def setup(self) -> None:
        """Start at the first value."""
        self._left = iter(self.factory.values)

    def loop(self) -> None:
        """Store the next value."""
        for value in self._left:
            self.store_data(self.factory.key, value)
            return
        if self.factory.exit_when_done:
            self.schedule(tasks.finish(ALL_REPLAYED))
        self.stop()


class TextReplayerFactory(LoopFactory):
    """Factory of a loop that stores the lines of a text file under a key, one at each tick, then stops.

    Args:
        key: of the pages; each has one line.
        exit: whether to end the node once the last line is fully processed.
        rate_hz: ticks per second.
        wait_for: a key: the next line is delayed until a new page with this key is stored, so that slow results
            keep up.
    """

    def __init__(
        self,
        file: str | Path,
        key: DataKey,
        exit: bool = False,  # noqa: A002 (the name in the thesis)
        rate_hz: float = 10.0,
        wait_for: DataKey | None = None,
    ) -> None:
        super().__init__()
        self.file: str | Path = file
        self.key: DataKey = key
        self.exit: bool = exit
        self.rate_hz: float = rate_hz
        self.wait_for: DataKey | None = wait_for

    def get(self, parent: NodeApi) -> TextReplayer:
        """Return the loop `<key>_replayer`."""
        return TextReplayer(self, parent, f"{self.key}_replayer", self.rate_hz)


class TextReplayer(Loop):
    """Stores the lines of the factory's file."""

    factory: TextReplayerFactory

    def setup(self) -> None:
        """Open the file."""
        self._reader = TextReader(self.factory.file)
        self._is_waiting = False
        self._answer: Page | None = None  # the newest one when the last line was stored

    def loop(self) -> None:
        """Store the next line, if the result of the last one has arrived."""
        wait_for = self.factory.wait_for
        if self._is_waiting and wait_for is not None and self.get_page(wait_for) is self._answer:
            return
        line = self._reader.read()
        if line is None:
            self._end()
            return
        if wait_for is not None:
            self._is_waiting = True
            self._answer = self.get_page(wait_for)
        self.store_data(self.factory.key, line)

    def _end(self) -> None:
        if self.factory.exit:
            self.schedule(tasks.finish(ALL_REPLAYED))
        self.stop()

    def terminate(self) -> None:
        """Close the file."""
        if "_reader" in self.__dict__:
            self._reader.close()


class ReplayerLoopFactory(LoopFactory):
    """Factory of a loop that stores the pages of a recording or a trace again, at their original times.

    They keep origin, time stamp and order. In lock step each is stored at exactly its time since the start of its run;
    on the wall clock as soon after it as threads allow. Pages that a second start appended to a recording follow those
    of the first. The node computes derived pages (results, commands) again, so replay its inputs only: the pages that
    came from sensors, links and people.

    Args:
        file: a recording, or the trace.jsonl of a run.
        exit: whether to end the node once the last page is fully processed.
        keys: of the pages to replay; all by default.
        node: whose pages to replay from a trace of several nodes; all by default.
        name: of the loop; unique among the replayers of a node.
    """

    def __init__(
        self,
        file: str | Path,
        exit: bool = False,  # noqa: A002 (as above)
        keys: Sequence[DataKey] | DataKey | None = None,
        node: str = "",
        name: str = "replayer",
    ) -> None:
        super().__init__()
        self.file: str | Path = file
        self.exit: bool = exit
        self.keys: Sequence[DataKey] | DataKey | None = keys
        self.node: str = node
        self.name: str = name

    def get(self, parent: NodeApi) -> ReplayerLoop:
        """Return the loop."""
        return ReplayerLoop(self, parent, self.name)


class ReplayerLoop(Loop):
    """Stores the pages of the factory's file, each at its time."""

    factory: ReplayerLoopFactory

    def setup(self) -> None:
        """Open the file and read its first page."""
        factory = self.factory
        self._reader = PageReader(factory.file, factory.keys, factory.node)
        self._start_s = self.get_time_s()
        self._next = self._reader.read_stored()
        if self._next is None:
            self.parent.add_note(f"'{self.name}' found none of the pages it is to bring in {factory.file}.")

    def loop(self) -> None:
        """Store the pages that are due, and set the next tick to the time of the next page."""
        now_s = self.get_time_s()
        while self._next is not None and self._start_s + self._next.time_s <= now_s:
            self.schedule(Task.store_page(self._next.page))
            self._next = self._reader.read_stored()
        if self._next is not None:
            self.next_tick_at_s = self._start_s + self._next.time_s
            return
        if self.factory.exit:
            self.schedule(tasks.finish(ALL_REPLAYED))
        self.stop()

    def terminate(self) -> None:
        """Print what was skipped and close the file."""
        if "_reader" in self.__dict__:
            for warning in self._reader.warnings:
                self.parent.add_note(warning)
            self._reader.close()
