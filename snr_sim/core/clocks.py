"""The two clocks: wall time for robots, virtual time for simulation, tests and grading."""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable
from typing import TypeAlias

from snr_sim.prelude.errors import ClockError

Callback: TypeAlias = Callable[[], None]


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
    >>> clock.call_at(0.5, lambda: print("now it is", clock.now_s()))
    >>> clock.run_next()
    now it is 0.5
    """

    def __init__(self) -> None:
        self._now_s = 0.0
        self._due: list[tuple[float, int, int, Callback]] = []
        self._count = 0
        self._followers: list[Callable[[float], None]] = []

    def now_s(self) -> float:
        """Return virtual seconds since the run began."""
        return self._now_s

    def call_at(self, time_s: float, callback: Callback, order: int = 0) -> None:
        """Schedule `callback` for `time_s`.

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
        heapq.heappush(self._due, (time_s, order, self._count, callback))

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
