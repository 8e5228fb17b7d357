"""A loop that looks at the files of the other components, and has those reloaded whose file was saved: `--watch`.

What it schedules is an input like any other, so a run that was watched replays.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping
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

# A file that was written so short a time ago may be written again without its time changing: it is read each time.
_YOUNG_NS = 100_000_000


class Seen(NamedTuple):
    """A file as it was when it was last looked at: time and size, unless it was still young, and contents."""

    mark: tuple[int, int] | None
    sha256: str


class WatchLoopFactory(LoopFactory):
    """Has components reloaded when their files are saved.

    Args:
        rate_hz: how often the files are looked at.
        name: of the loop.
    """

    def __init__(self, rate_hz: float = 2.0, name: str = "watch") -> None:
        super().__init__()
        self.rate_hz = rate_hz
        self.name = name
        self.seen: dict[Path, Seen] = {}

    def get(self, parent: NodeApi) -> WatchLoop:
        """Return the loop."""
        return WatchLoop(self, parent, self.name, self.rate_hz)


class WatchLoop(Loop):
    """Looks at files; one that was only half saved is reloaded again when the rest has come."""

    factory: WatchLoopFactory
    is_of_robot = False

    def __init__(self, factory: WatchLoopFactory, parent: NodeApi, name: str, rate_hz: float) -> None:
        super().__init__(factory, parent, name, rate_hz)
        self._looked_at: Mapping[str, Component] | None = None
        self._users: dict[Path, list[str]] = {}

    def setup(self) -> None:
        """Take the files as they are."""
        self._changed()

    def loop(self) -> None:
        """Have those components reloaded whose files are not what they were."""
        names = [name for path in self._changed() for name in self._users[path]]
        if names:
            self.schedule(tasks.reload_component(*dict.fromkeys(names)))

    def _changed(self) -> list[Path]:
        components = self.parent.components
        if components is not self._looked_at:  # the node makes a new dict when a component comes or goes
            self._looked_at, self._users = components, files_of(components)
        return [path for path in self._users if self._has_changed(path)]

    def _has_changed(self, path: Path) -> bool:
        seen = self.factory.seen
        before = seen.get(path)
        try:
            stat = path.stat()
            mark = (stat.st_mtime_ns, stat.st_size)
            if stat.st_size == 0 or (before is not None and before.mark == mark):
                return False  # an editor that is about to write empties a file first
            sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError:
            return False  # some editors put a new file in the old one's place
        is_young = time.time_ns() - stat.st_mtime_ns < _YOUNG_NS
        seen[path] = Seen(None if is_young else mark, sha256)
        return before is not None and before.sha256 != sha256


def files_of(components: Mapping[str, Component]) -> dict[Path, list[str]]:
    """Return the files that a reload of these components would read, with the names of those who stand in each."""
    users: dict[Path, list[str]] = {}
    for name, component in components.items():
        if not isinstance(component, NodeComponent) or not component.is_of_robot:
            continue
        try:
            modules = modules_of(component.factory, component)
        except ConfigError:
            continue  # its reload says so
        for module in modules:
            path = file_of(module)
            if path is not None:
                users.setdefault(path, []).append(name)
                with suppress(OSError):  # it has just been moved away
                    source_of(module)  # from now on it is known, for messages about code that goes on after a reload
    return users


def watched(config: Config) -> Config:
    """Return the same config with a watch in each role."""
    factories = {role: [*given, WatchLoopFactory()] for role, given in config.factories.items()}
    return Config(config.mode, factories, **config.bounds)
