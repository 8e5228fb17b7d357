"""File watch (`--watch`): a loop that polls the files of the other components and reloads those that were saved.

The tasks it schedules are inputs like any other, so a run with a watch can be replayed.

The watch is not part of the robot, so a replay runs without it.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from snr_sim.core.component import NodeComponent
from snr_sim.core.config import Config
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.reload.sources import file_of, modules_of, source_of
from snr_sim.prelude import tasks
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks

# A file written this recently can be written again with the same modification time, so its content is read each time.
_MTIME_GRANULARITY_NS = 100_000_000
_OF_NOTHING = hashlib.sha256().hexdigest()


class FileStamp(NamedTuple):
    """State of a file at the last check: time and size, unless it was just written, and content."""

    mark: tuple[int, int] | None
    sha256: str


class WatchLoopFactory(LoopFactory):
    """Factory of a loop that reloads components when their files are saved.

    Args:
        rate_hz: how often the files are checked.
        name: of the loop.
    """

    def __init__(self, rate_hz: float = 2.0, name: str = "watch") -> None:
        super().__init__()
        self.rate_hz: float = rate_hz
        self.name: str = name
        self.seen: dict[Path, FileStamp] = {}

    def get(self, parent: NodeApi) -> WatchLoop:
        """Return the loop."""
        return WatchLoop(self, parent, self.name, self.rate_hz)


class WatchLoop(Loop):
    """Loop that checks files; a partly saved file is reloaded again when the rest is written."""

    factory: WatchLoopFactory
    is_robot_component = False

    def __init__(self, factory: WatchLoopFactory, parent: NodeApi, name: str, rate_hz: float) -> None:
        super().__init__(factory, parent, name, rate_hz)
        self._components: Mapping[str, Component] | None = None
        self._users: dict[Path, list[str]] = {}
        self._texts: dict[Path, Callable[[], SomeTasks]] = {}

    def setup(self) -> None:
        """Read the present state of the files."""
        self._changed()

    def loop(self) -> None:
        """Schedule a reload of the components whose files have changed, and what components make of other files."""
        changed = self._changed()
        names = [name for path in changed for name in self._users.get(path, ())]
        if names:
            self.schedule(tasks.reload_component(*dict.fromkeys(names)))
        for saved in dict.fromkeys(self._texts[path] for path in changed if path in self._texts):
            with suppress(OSError):  # it has just been moved away
                self.schedule(saved())

    def _changed(self) -> list[Path]:
        components = self.parent.components
        if components is not self._components:  # the node creates a new dict when components are added or removed
            self._components, self._users = components, files_of(components)
        self._texts = {path: saved for one in _watchable(components) for path, saved in one.watched_files.items()}
        return [path for path in dict.fromkeys((*self._users, *self._texts)) if self._has_changed(path)]

    def _has_changed(self, path: Path) -> bool:
        seen = self.factory.seen
        before = seen.get(path)
        try:
            stat = path.stat()
            mark = (stat.st_mtime_ns, stat.st_size)
            if before is not None and before.mark == mark and (stat.st_size or before.sha256 == _OF_NOTHING):
                return False
            if before is not None and not stat.st_size and (path not in self._texts or before.mark != mark):
                # Some editors empty a file before they write it. Only a text may stay so, until the next check.
                seen[path] = before._replace(mark=mark)
                return False
            sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError:
            seen.setdefault(path, FileStamp(None, ""))
            return False  # some editors replace the file by a new one
        is_recent = time.time_ns() - stat.st_mtime_ns < _MTIME_GRANULARITY_NS
        seen[path] = FileStamp(None if is_recent else mark, sha256)
        return before is not None and before.sha256 != sha256


def files_of(components: Mapping[str, Component]) -> dict[Path, list[str]]:
    """Return the files that a reload of these components would read, with the names of the components in each."""
    users: dict[Path, list[str]] = {}
    for component in _watchable(components):
        name = component.name
        try:
            modules = modules_of(component.factory, component)
        except ConfigError:
            continue  # its reload reports it
        for module in modules:
            path = file_of(module)
            if path is not None:
                users.setdefault(path, []).append(name)
                with suppress(OSError):  # it has just been moved away
                    source_of(module)  # keeps it for tracebacks of code that still runs after a reload
    return users


def _watchable(components: Mapping[str, Component]) -> Iterator[NodeComponent]:
    for one in components.values():
        if isinstance(one, NodeComponent) and one.is_robot_component:
            yield one


def with_watch(config: Config) -> Config:
    """Return the same config with a watch loop in each role."""
    factories = {role: [*given, WatchLoopFactory()] for role, given in config.factories.items()}
    return Config(config.mode, factories, **config.bounds)
