"""Loops: the components that bring the outside in. What a loop schedules is an input; everything else follows.

The author writes `setup`, `loop`, `halt` and `terminate`; who calls them is the backing's business
(`core/backing.py`): the virtual clock in lock step, or a thread of its own on the wall clock.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import cached_property
from types import ModuleType
from typing import TYPE_CHECKING, Any

from snr_sim.core.backing import Backing, ClockBacking, ThreadBacking
from snr_sim.core.clocks import SimClock
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.page import DataKey, Page
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.task import SomeTasks, Task, TaskHandlerMap, TaskType

if TYPE_CHECKING:
    import numpy as np

    from snr_sim.core.node import Node

_STORE_PAGE = TaskType.store_page  # looked up once: in Python 3.11 a member of an Enum takes 0.1 us to find


class LoopFactory:
    """Makes a loop for a node. What it keeps itself survives when the loop is made anew.

    Args:
        reload_targets: modules whose code is read again when the loop is reloaded.
    """

    def __init__(self, reload_targets: ModuleType | Sequence[ModuleType] | None = None) -> None:
        targets = [reload_targets] if isinstance(reload_targets, ModuleType) else reload_targets
        self.reload_targets: list[ModuleType] = list(targets or [])

    def get(self, parent: Node) -> Loop:
        """Returns a new loop that belongs to the node `parent`."""
        raise NotImplementedError(f"{type(self).__name__} needs a method get(self, parent) that returns its loop")


class Loop:
    """A component that is called again and again, at a rate.

    Args:
        factory: who made it.
        parent: its node.
        name: unique in the node.
        max_tick_rate_hz: how often `loop` is called; deadlines are kept, so work does not slow the rate down.
            0 is as often as possible on a thread, and 1000 Hz in lock step, where time must move.

    Raises:
        ParameterError: the rate is negative or not a number.
    """

    first_tick_after_s: float = 0.0  # how long after `begin` the first `loop` comes; a loop may set its own

    def __init__(self, factory: LoopFactory, parent: Node, name: str, max_tick_rate_hz: float = 1000.0) -> None:
        if not 0 <= max_tick_rate_hz < float("inf"):
            raise ParameterError(
                f"Loop '{name}' has max_tick_rate_hz={max_tick_rate_hz!r}.", fix="a rate of 0 or more, such as 50."
            )
        self.factory = factory
        self.parent = parent
        self.name = name
        self.max_tick_rate_hz = max_tick_rate_hz
        self.task_handlers: TaskHandlerMap = {}  # a loop brings tasks in; handling them is an endpoint's work
        self._backing: Backing | None = None

    def setup(self) -> None:
        """Called once before the first `loop`, on the thread that will call it."""

    def loop(self) -> None:
        """Called at each tick; schedules tasks or stores data."""
        raise NotImplementedError(f"{type(self).__name__} needs a method loop(self)")

    def halt(self) -> None:
        """Called once after the last `loop`, on the same thread."""

    def terminate(self) -> None:
        """Called once at the very end, on the node's thread, to let go of files and wires."""

    def begin(self) -> None:
        """Starts ticking."""
        backing: Backing = ClockBacking(self) if isinstance(self.parent.clock, SimClock) else ThreadBacking(self)
        self._backing = backing
        backing.start()

    def stop(self) -> None:
        """Asks for no more ticks: a loop that has nothing left to bring calls this itself."""
        if self._backing is not None:
            self._backing.stop()

    def join(self) -> None:
        """Ends ticking and returns once `halt` has been called."""
        if self._backing is not None:
            self._backing.join()

    def is_terminated(self) -> bool:
        """Returns whether no more ticks will come."""
        return self._backing is not None and self._backing.is_stopped

    def schedule(self, tasks: SomeTasks) -> None:
        """Lets tasks into the node: these are its inputs."""
        self.parent.enter(tasks, self.name)

    def page(self, key: DataKey, data: Any, process: bool = True) -> Page:
        """Returns a page made by this node, now."""
        return Page(key, data, self.parent.name, self.parent.clock.now_s(), process)

    def store_data(self, key: DataKey, data: Any, process: bool = True) -> None:
        """Has data stored under a key."""
        self.parent.enter(self.store_data_task(key, data, process), self.name)

    def store_data_task(self, key: DataKey, data: Any, process: bool = True) -> Task:
        """Returns the task that stores data under a key."""
        return Task(_STORE_PAGE, key, [self.page(key, data, process)])

    def get_page(self, key: DataKey) -> Page | None:
        """Returns the newest page of a key, or None if nothing has stored it (yet)."""
        return self.parent.get_page(key)

    def get_data(self, key: DataKey) -> Any:
        """Returns the newest data of a key, or None if nothing has stored it (yet)."""
        return self.parent.get_data(key)

    def get_time_s(self) -> float:
        """Returns the clock's time."""
        return self.parent.clock.now_s()

    @cached_property
    def rng(self) -> np.random.Generator:
        """The loop's own random generator, derived from the run's seed and its name."""
        return rng_for(self.parent.seed, self.name)

    @cached_property
    def log(self) -> logging.Logger:
        """A logger named after node and component."""
        return logging.getLogger(f"snr.{self.parent.name}.{self.name}")


class ThreadLoop(Loop):
    """The thesis' name for a loop. On the wall clock it has a thread; in lock step the clock calls it."""
