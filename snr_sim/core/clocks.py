"""The two clocks: wall time for robots, virtual time for simulation, tests and grading, where the clock calls loops."""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable
from typing import TypeAlias

from snr_sim.core.loop import NEVER_S, Loop, WakingPages
from snr_sim.core.node_life import NodeLife
from snr_sim.prelude.errors import ClockError, ComponentFailedError

Callback: TypeAlias = Callable[[], None]
Due: TypeAlias = tuple[float, int, int, Callback]  # when, order, number of the call, what
_UNLIMITED_RATE_IN_LOCK_STEP_HZ = 1000.0


class WallClock:
    """Seconds since creation, from the monotonic clock: setting the computer's clock does not change it.

    Args:
        start_s: `time.monotonic()` at zero, to share the zero of another process' clock; default: now.
    """

    def __init__(self, start_s: float | None = None) -> None:
        self._start_s = time.monotonic() if start_s is None else start_s

    def now_s(self) -> float:
        """Return seconds since the clock was created."""
        return time.monotonic() - self._start_s

    def sleep_until(self, time_s: float) -> None:
        """Sleep until `time_s`."""
        delay_s = time_s - self.now_s()
        if delay_s > 0:
            time.sleep(delay_s)


class SimClock:
    """Virtual time: constant while work is done, then advanced to the next instant at which something is due.

    All waiting of a simulated run happens here. Callbacks are scheduled with `call_at`. A component that has to keep up
    with time, such as a plant, registers with `follow` and is advanced to each new instant before any callback runs.

    >>> clock = SimClock()
    >>> due = clock.call_at(0.5, lambda: print("now it is", clock.now_s()))
    >>> clock.run_next()
    now it is 0.5
    """

    def __init__(self) -> None:
        self._now_s = 0.0
        self._due: list[Due] = []
        self._count = 0
        self._followers: list[Callable[[float], None]] = []

    def now_s(self) -> float:
        """Return virtual seconds since the run began."""
        return self._now_s

    def call_at(self, time_s: float, callback: Callback, order: int = 0) -> Due:
        """Schedule `callback` for `time_s`; return what `cancel` needs.

        Args:
            time_s: not before now.
            callback: takes and returns nothing.
            order: sort key among callbacks due at the same instant: lower first, then in the order of the calls.

        Raises:
            ClockError: `time_s` is in the past.
        """
        if time_s < self._now_s:
            raise ClockError(
                f"Something asked to be called at {time_s:.6f} s, but it is already {self._now_s:.6f} s.",
                fix="ask for a moment that is still to come: now_s() plus a delay.",
            )
        self._count += 1
        due = time_s, order, self._count, callback
        heapq.heappush(self._due, due)
        return due

    def cancel(self, due: Due) -> None:
        """Forget a call that has not been made: time does not stop at it."""
        self._due.remove(due)
        heapq.heapify(self._due)

    def follow(self, advance_to: Callable[[float], None]) -> None:
        """Register `advance_to(time_s)` to be called at each new instant, before the callbacks due then."""
        self._followers.append(advance_to)

    @property
    def next_s(self) -> float | None:
        """The next instant at which something is due, or None."""
        return self._due[0][0] if self._due else None

    def run_next(self) -> None:
        """Advance to the next due instant and run its first callback."""
        time_s, _, _, callback = heapq.heappop(self._due)
        if time_s > self._now_s:
            self._now_s = time_s
            for advance_to in self._followers:
                advance_to(time_s)
        callback()

    def sleep_until(self, time_s: float) -> None:
        """Raise a ClockError unless `time_s` has passed: in lock step time advances only between tasks."""
        if time_s > self._now_s:
            raise ClockError(
                f"Something slept until {time_s:.3f} s under the virtual clock, where time moves only between tasks.",
                fix="let a loop tick at that rate (max_tick_rate_hz), or use TimeoutLoopFactory.",
            )


class ClockExecutor:
    """Executor that lets the virtual clock call the loop on the node's thread: tick k is at exactly k / rate."""

    setup_timeout_s: float = 0.0  # `start` calls `setup` itself

    def __init__(self, loop: Loop, life: NodeLife) -> None:
        assert isinstance(loop.parent.clock, SimClock)
        self._loop = loop
        self._life = life
        self._clock = loop.parent.clock
        self._rate_hz = loop.max_tick_rate_hz or _UNLIMITED_RATE_IN_LOCK_STEP_HZ
        self._start_s = self._clock.now_s() + loop.first_tick_after_s
        self._order = life.registry.order_of(loop.name)
        self._must_halt = False
        self._at_once = 0  # consecutive ticks that were requested at once
        self._pages = WakingPages(loop, self)
        self._periods = 0  # from the start to the next tick of the loop's rate
        self._is_woken = False  # a tick in addition to the rate is due at this moment
        self._next: Due | None = None  # the next tick that no page has caused
        self._next_tick_at_s: float | None = None  # of the loop, when that tick was scheduled
        self.is_stopped: bool = False
        self.ticks: int = 0
        self.late_s: float = 0.0

    def start(self) -> None:
        """Call `setup` and schedule the first tick on the clock."""
        self._must_halt = True  # before setup: a loop whose setup fails must be halted too, as on a thread
        self._life.call_loop(self._loop, "setup")
        self._pages.begin()
        self._next = self._clock.call_at(self._start_s, self._tick, self._order)

    def _tick(self) -> None:
        self._next = None
        self._call()
        self._schedule()

    def _tick_woken(self) -> None:
        self._is_woken = False
        self._call()
        if self._loop.next_tick_at_s != self._next_tick_at_s:
            self._schedule()

    def _schedule(self) -> None:
        """Schedule the next tick in place of the one that was scheduled."""
        if self._next is not None:
            self._clock.cancel(self._next)
            self._next = None
        if self.is_stopped:
            return
        self._next_tick_at_s, time_s = self._loop.next_tick_at_s, self._next_s()
        if time_s < NEVER_S and not self.is_stopped:
            self._next = self._clock.call_at(time_s, self._tick, self._order)

    def _call(self) -> None:
        if self.is_stopped:
            return
        self.ticks += 1
        try:
            self._life.call_loop(self._loop, "loop")
        except ComponentFailedError as failure:
            self._fail(failure)

    def _fail(self, failure: ComponentFailedError) -> None:
        self.is_stopped = True
        if not self._life.handle_failure(self._loop, failure):
            raise failure

    def _next_s(self) -> float:
        target_s, now_s = self._loop.next_tick_at_s, self._clock.now_s()
        if target_s is None:
            # A product would drift in the last digits; ticks of loops with equal rates need equal floats.
            while (time_s := self._start_s + self._periods / self._rate_hz) <= now_s:
                self._periods += 1
            return time_s
        if target_s > now_s:
            self._at_once = 0
            return target_s
        self._at_once += 1
        if self._at_once > self._life.node.config.max_tasks_per_moment:
            self._fail(self._life.report.failure_of(self._loop, _standstill_error(target_s, self._at_once - 1), "loop"))
        return now_s

    def wake(self) -> None:
        """Do nothing: tasks scheduled for an instant are executed before the ticks of that instant anyway."""

    def tick_now(self) -> None:
        """Call the loop at this moment, once the node has nothing left to do."""
        if not self._is_woken and not self.is_stopped:
            self._is_woken = True
            self._clock.call_at(self._clock.now_s(), self._tick_woken, self._order)

    def stop(self) -> None:
        """Ask for no more ticks."""
        self.is_stopped = True

    def join(self) -> None:
        """Stop and halt the loop."""
        self.is_stopped = True
        self._pages.end()
        if self._must_halt:
            self._must_halt = False
            self._loop.halt()


def _standstill_error(target_s: float, ticks: int) -> ClockError:
    return ClockError(
        f"After each of {ticks} ticks in a row next_tick_at_s was {target_s:g}, which is not later: time stands still.",
        fix="next_tick_at_s = self.get_time_s() + a delay; or leave it alone, and the loop keeps its max_tick_rate_hz.",
    )
