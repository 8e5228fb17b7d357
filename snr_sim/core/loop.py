"""Loops: components that are the sources of a node's inputs. Every other task is the result of an input.

The author writes `setup`, `loop`, `halt` and `terminate`; an executor calls them: the virtual clock in lock step
(`core/clocks.py`); on the wall clock a thread of the loop's own (`core/thread_executor.py`), or a process.
"""

from __future__ import annotations

from collections import deque
from math import isnan
from numbers import Real
from queue import Empty
from typing import Any, Literal, Protocol

from snr_sim.core.component import NodeComponent
from snr_sim.core.factory import ComponentFactory, FactoryOfClass
from snr_sim.core.thesis_members import LoopMembers
from snr_sim.prelude.errors import ComponentFailedError, ParameterError, suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.renamed import warn_renamed
from snr_sim.prelude.task import DataKey, Page, SomeTasks, TaskHandlerMap
from snr_sim.prelude.waiting import TimedQueue

NEVER_S: float = 1e300  # as `next_tick_at_s`: no time. Finite, so that JSON can carry it
_EXECUTORS = ("thread", "process")


class LoopExecutor(Protocol):
    """Interface that starts, calls and ends one loop."""

    ticks: int
    late_s: float  # the largest delay of a tick behind its deadline
    # How long the caller that adds the loop to a running node waits for the result of `setup`; then success is assumed.
    setup_timeout_s: float

    @property
    def is_stopped(self) -> bool:
        """Whether no more ticks will follow."""

    def start(self) -> None:
        """Begin calling."""

    def wake(self) -> None:
        """Request the next call now; no effect in lock step and in a process."""

    def tick_now(self) -> None:
        """Request a call at once, beside those at the loop's rate."""

    def stop(self) -> None:
        """Request no more calls; return at once."""

    def join(self) -> None:
        """Stop, and return once `halt` has been called."""


class WakingPages:
    """Lets an executor call its loop at once when one of the pages in the loop's `wakes_on` is stored."""

    def __init__(self, loop: Loop, executor: LoopExecutor) -> None:
        self._loop, self._executor = loop, executor
        self._listening: list[DataKey] = []

    def begin(self) -> None:
        """Listen from now on. On the node's thread, as `end`."""
        for key in self._loop.wakes_on:
            self._loop.parent.add_store_listener(key, self._on_page)
            self._listening.append(key)

    def end(self) -> None:
        """Listen no more. Safe to call twice."""
        while self._listening:
            self._loop.parent.remove_store_listener(self._listening.pop(), self._on_page)

    def _on_page(self, page: Page) -> None:
        self._executor.tick_now()


class SetupResult:
    """Result of a `setup` on another thread, for one caller that waits; each side learns whether the other is there.

    On a thread, `setup` fails after `begin` has returned. At the start of a node, such a failure ends the node. In a
    reload the old loop has to continue instead; so the reload waits a short time for the result.
    """

    def __init__(self) -> None:
        self._result: TimedQueue[ComponentFailedError | None] = TimedQueue()
        self._token = deque([None])  # the first side takes it: `pop` is atomic, and no lock can stay held

    def set_result(self, failure: ComponentFailedError | None) -> bool:
        """Set the result; return whether a caller was waiting for it."""
        if not self._is_first():
            return False
        self._result.put(failure)
        return True

    def wait(self, timeout_s: float) -> ComponentFailedError | None:
        """Wait for the result; return the failure, or None after success or the timeout, which ends the wait."""
        try:
            return self._result.get(timeout_s)
        except Empty:
            return None if self._is_first() else self._result.get()

    def _is_first(self) -> bool:
        try:
            self._token.pop()
        except IndexError:
            return False
        return True


def _is_rate(value: object) -> bool:
    return isinstance(value, Real) and 0 <= float(value) < float("inf")


def _is_time(value: object) -> bool:
    return isinstance(value, Real) and not isnan(float(value))


class LoopFactory(ComponentFactory):
    """Factory of a loop."""

    def get(self, parent: NodeApi) -> Loop:
        """Return a new loop that belongs to the node `parent`."""
        loop: Loop = self._create(parent, "loop")
        return loop


class Loop(LoopMembers, NodeComponent):
    """A component that is called periodically.

    Args:
        factory, parent, name: as of every component.
        max_tick_rate_hz: how often `loop` is called; deadlines are kept, so work does not slow the rate down.
            0 is as often as possible on a thread, and 1000 Hz in lock step, where time must advance. Default: the
            class attribute.

    Raises:
        ParameterError: the rate is negative or not a number, or the executor is unknown.
    """

    # What calls the loop on the wall clock. "process" is for heavy work, such as vision: in a thread it would hold the
    # interpreter lock and block the rest of the node. In lock step the virtual clock calls all loops.
    executor: Literal["thread", "process"] = "thread"
    max_tick_rate_hz: float = 1000.0
    first_tick_after_s: float = 0.0  # delay from `begin` to the first `loop`; a loop may set its own
    # Keys of pages after which `loop` is called at once, beside its rate: in lock step at the same moment, when
    # everything else at that moment is done.
    wakes_on: tuple[DataKey, ...] = ()

    factory: FactoryOfClass = FactoryOfClass(LoopFactory)

    def __init_subclass__(cls, **options: Any) -> None:
        """Accept `backing`, the former name of `executor`."""
        super().__init_subclass__(**options)
        if "backing" in cls.__dict__:
            warn_renamed(f"{cls.__name__}.backing", "executor")
            cls.executor = cls.__dict__["backing"]

    def __init__(self, factory: LoopFactory, parent: NodeApi, name: str, max_tick_rate_hz: float | None = None) -> None:
        super().__init__(factory, parent, name)
        rate_hz = self.max_tick_rate_hz if max_tick_rate_hz is None else max_tick_rate_hz
        if not _is_rate(rate_hz):
            raise ParameterError(
                f"Loop '{name}' has max_tick_rate_hz={rate_hz!r}.", fix="a rate of 0 or more, such as 50."
            )
        self._check_executor()
        self.max_tick_rate_hz = rate_hz
        self.task_handlers: TaskHandlerMap = {}  # a loop only sends tasks; endpoints handle them
        self._executor: LoopExecutor | None = None
        self._next_tick_at_s: float | None = None
        self.setup_result: SetupResult | None = None  # of `setup` on a thread, if a caller waits
        self.is_removed: bool = False  # removed: its node continues, whatever its `halt` raises

    def setup(self) -> SomeTasks:
        """Prepare; called once before the first `loop`, on the same thread. It may return tasks, as `loop`."""

    def loop(self) -> SomeTasks:
        """Schedule tasks, return them, or store data; called at each tick."""
        raise NotImplementedError(f"{type(self).__name__} needs a method loop(self)")

    def halt(self) -> None:
        """End the work; called once after the last `loop`, on the same thread."""

    def on_death(self, message: str) -> SomeTasks:
        """Return the tasks to send when its process has died; called on another thread. None ends the node."""
        return None

    def begin(self) -> None:
        """Start ticking.

        Raises:
            ConfigError: the loop is to run in a process, and its factory cannot be sent there.
        """
        self._check_executor()  # again: it may have been set after __init__
        self.parent.start_loop(self)

    def _check_executor(self) -> None:
        if self.executor not in _EXECUTORS:
            raise ParameterError(
                f"Loop '{self.name}' has executor = {self.executor!r}.", fix=suggest(str(self.executor), _EXECUTORS)
            )

    def begin_with(self, executor: LoopExecutor) -> None:
        """Start ticking with a given executor: in a process that process' own; elsewhere `begin` chooses it."""
        self._executor = executor
        executor.start()

    @property
    def next_tick_at_s(self) -> float | None:
        """Node time of the next `loop`; None: the next of its rate.

        A loop that is not periodic, or idle for a time, sets it in each `loop`, also if a page has caused it. A time in
        the past means at once; NEVER_S that only a page in `wakes_on` causes the next one, or on a thread `wake`.

        Raises:
            ParameterError: it is set to something that is not a number.
        """
        return self._next_tick_at_s

    @next_tick_at_s.setter
    def next_tick_at_s(self, time_s: float | None) -> None:
        if time_s is not None and not _is_time(time_s):
            raise ParameterError(
                f"Loop '{self.name}' has next_tick_at_s = {time_s!r}, which is not a time.",
                fix="self.get_time_s() plus a delay, or None.",
            )
        self._next_tick_at_s = time_s

    def wake(self) -> None:
        """Request the next tick now instead of when it is due, because new data arrived. From any thread.

        Affects loops on a thread only. A loop ticks at most at twice its rate, however often this is called.
        """
        if self._executor is not None:
            self._executor.wake()

    def stop(self) -> None:
        """Request no more ticks; a loop that has no more input calls this itself."""
        if self._executor is not None:
            self._executor.stop()

    def set_terminate_flag(self) -> None:
        """Request no more ticks: the thesis' name for `stop`."""
        self.stop()

    def join(self) -> None:
        """End ticking and return once `halt` has been called."""
        if self._executor is not None:
            self._executor.join()

    def is_terminated(self) -> bool:
        """Return whether no more ticks will follow."""
        return self._executor is not None and self._executor.is_stopped

    @property
    def caller(self) -> LoopExecutor | None:
        """The loop's executor, once it has begun; counts its ticks and measures their delay."""
        return self._executor

    def schedule(self, tasks: SomeTasks) -> None:
        """Send tasks to the node as its inputs."""
        self.parent.enqueue_input(tasks, self.name)

    def get_time_s(self) -> float:
        """Return the clock's time."""
        return self.parent.clock.now_s()


class ThreadLoop(Loop):
    """The thesis' name for a loop. On the wall clock it has a thread; in lock step the clock calls it."""
