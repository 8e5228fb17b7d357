"""Loops: the components that bring the outside in. What a loop schedules is an input; everything else follows.

The author writes `setup`, `loop`, `halt` and `terminate`; who calls them is the backing's business
(`core/backing.py`): the virtual clock in lock step; on the wall clock a thread of its own, or a process.
"""

from __future__ import annotations

from numbers import Real
from typing import Literal, Protocol

from snr_sim.core.component import ComponentFactory, NodeComponent
from snr_sim.core.reload.trial import Trial
from snr_sim.core.thesis_members import LoopMembers
from snr_sim.prelude.errors import ParameterError, nearest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, TaskHandlerMap

_BACKINGS = ("thread", "process")


class Backing(Protocol):
    """Starts, calls and ends one loop."""

    ticks: int
    late_s: float  # the largest delay of a tick behind its deadline
    # How long whoever begins the loop in a running node waits to hear of its `setup`; then it is taken to be well.
    setup_patience_s: float

    @property
    def is_stopped(self) -> bool:
        """Whether no more ticks will come."""
        ...

    def start(self) -> None:
        """Begin calling."""
        ...

    def hurry(self) -> None:
        """Ask for the next call now; in lock step and in a process it comes when it is due all the same."""
        ...

    def stop(self) -> None:
        """Ask for no more calls; return at once."""
        ...

    def join(self) -> None:
        """Stop, and return once `halt` has been called."""
        ...


def _is_rate(value: object) -> bool:
    return isinstance(value, Real) and 0 <= float(value) < float("inf")


class LoopFactory(ComponentFactory):
    """Makes a loop for a node."""

    def get(self, parent: NodeApi) -> Loop:
        """Return a new loop that belongs to the node `parent`."""
        raise NotImplementedError(f"{type(self).__name__} needs a method get(self, parent) that returns its loop")


class Loop(LoopMembers, NodeComponent):
    """A component that is called again and again, at a rate.

    Args:
        factory: who made it.
        parent: its node.
        name: unique in the node.
        max_tick_rate_hz: how often `loop` is called; deadlines are kept, so work does not slow the rate down.
            0 is as often as possible on a thread, and 1000 Hz in lock step, where time must move. If not given:
            what the class says.

    Raises:
        ParameterError: the rate is negative or not a number, or nobody knows the backing.
    """

    # What calls the loop on the wall clock. "process" is for heavy work, such as vision: a thread would keep everything
    # else in the node from running. In lock step the virtual clock calls all loops.
    backing: Literal["thread", "process"] = "thread"
    max_tick_rate_hz: float = 1000.0
    first_tick_after_s: float = 0.0  # how long after `begin` the first `loop` comes; a loop may set its own
    # When the next `loop` is to come, by the node's time, for a loop that knows better than its rate; it sets it anew
    # in each `loop`. At once if that has passed.
    next_tick_at_s: float | None = None

    def __init__(self, factory: LoopFactory, parent: NodeApi, name: str, max_tick_rate_hz: float | None = None) -> None:
        rate_hz = self.max_tick_rate_hz if max_tick_rate_hz is None else max_tick_rate_hz
        if not _is_rate(rate_hz):
            raise ParameterError(
                f"Loop '{name}' has max_tick_rate_hz={rate_hz!r}.", fix="a rate of 0 or more, such as 50."
            )
        super().__init__(factory, parent, name)
        self._check_backing()
        self.max_tick_rate_hz = rate_hz
        self.task_handlers: TaskHandlerMap = {}  # a loop brings tasks in; handling them is an endpoint's work
        self._backing: Backing | None = None
        self.trial: Trial | None = None  # who waits for its `setup` on a thread, if somebody does
        self.is_taken_out = False  # its node goes on without it, whatever its `halt` raises

    def setup(self) -> None:
        """Prepare; called once before the first `loop`, on the thread that will call it."""

    def loop(self) -> None:
        """Schedule tasks or store data; called at each tick."""
        raise NotImplementedError(f"{type(self).__name__} needs a method loop(self)")

    def halt(self) -> None:
        """End the work; called once after the last `loop`, on the same thread."""

    def begin(self) -> None:
        """Start ticking.

        Raises:
            ConfigError: the loop is to run in a process, and its factory cannot be sent there.
        """
        self._check_backing()  # again: it may have been chosen after the loop was made
        self.parent.start_loop(self)

    def _check_backing(self) -> None:
        if self.backing not in _BACKINGS:
            raise ParameterError(
                f"Loop '{self.name}' has backing = {self.backing!r}.", fix=nearest(str(self.backing), _BACKINGS)
            )

    def begin_on(self, backing: Backing) -> None:
        """Start ticking on a backing: in a process the process' own, anywhere else `begin` chooses."""
        self._backing = backing
        backing.start()

    def hurry(self) -> None:
        """Have the next tick come now, on a thread, and not when it is due: there is news. For any thread.

        A loop ticks no more than twice as often as its rate says, however it is hurried. In lock step nothing changes.
        """
        if self._backing is not None:
            self._backing.hurry()

    def stop(self) -> None:
        """Ask for no more ticks: a loop that has nothing left to bring calls this itself."""
        if self._backing is not None:
            self._backing.stop()

    def set_terminate_flag(self) -> None:
        """Ask for no more ticks: the thesis' name for `stop`."""
        self.stop()

    def join(self) -> None:
        """End ticking and return once `halt` has been called."""
        if self._backing is not None:
            self._backing.join()

    def is_terminated(self) -> bool:
        """Return whether no more ticks will come."""
        return self._backing is not None and self._backing.is_stopped

    @property
    def caller(self) -> Backing | None:
        """Who calls the loop, once it has begun; knows how often that was, and how late."""
        return self._backing

    def schedule(self, tasks: SomeTasks) -> None:
        """Let tasks into the node: these are its inputs."""
        self.parent.enter(tasks, self.name)

    def get_time_s(self) -> float:
        """Return the clock's time."""
        return self.parent.clock.now_s()


class ThreadLoop(Loop):
    """The thesis' name for a loop. On the wall clock it has a thread; in lock step the clock calls it."""
