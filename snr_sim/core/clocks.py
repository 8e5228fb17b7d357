"""The two clocks: wall time for robots, virtual time for simulation, tests and grading."""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable
from typing import TypeAlias

from snr_sim.prelude.errors import ClockError

Callback: TypeAlias = Callable[[], None]


class WallClock:
    """Seconds since it was made, from the monotonic clock: setting the computer's clock does not move it.

    Args:
        start_s: `time.monotonic()` at zero, if it goes on where another process' clock began; now if not given.
    """

    def __init__(self, start_s: float | None = None) -> None:
        self._start_s = time.monotonic() if start_s is None else start_s

    def now_s(self) -> float:
        """Return seconds since the clock was made."""
        return time.monotonic() - self._start_s

    def sleep_until(self, time_s: float) -> None:
        """Sleep until `time_s` has come."""
        delay_s = time_s - self.now_s()
        if delay_s > 0:
            time.sleep(delay_s)


class SimClock:
    """Virtual time: it stands still while work is done, and jumps to the next moment when something is due.

    It owns all waiting of a simulated run. Whoever wants to be called says when (`call_at`); whoever has to keep up
    with time, such as a plant, follows it (`follow`) and is brought to each new moment before anybody is called.

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
        """Have `callback` called when `time_s` comes.

        Args:
            time_s: not before now.
            callback: takes and returns nothing.
            order: who goes first of those due at the same moment: lower first, then who asked first.

        Raises:
            ClockError: the moment has passed.
        """
        if time_s < self._now_s:
            raise ClockError(
                f"Something asked to be called at {time_s:.6f} s, but it is already {self._now_s:.6f} s.",
                fix="ask for a moment that is still to come: now_s() plus a delay.",
            )
        self._count += 1
        heapq.heappush(self._due, (time_s, order, self._count, callback))

    def follow(self, advance_to: Callable[[float], None]) -> None:
        """Have `advance_to(time_s)` called at each new moment, before anything that is due then."""
        self._followers.append(advance_to)

    @property
    def next_s(self) -> float | None:
        """The next moment at which something is due, or None."""
        return self._due[0][0] if self._due else None

    def run_next(self) -> None:
        """Jump to the next moment and call the first thing that is due then."""
        time_s, _, _, callback = heapq.heappop(self._due)
        if time_s > self._now_s:
            self._now_s = time_s
            for advance_to in self._followers:
                advance_to(time_s)
        callback()

    def sleep_until(self, time_s: float) -> None:
        """Refuse: in lock step the world waits for whoever runs, so a sleep would last for ever.

        Raises:
            ClockError: always, unless `time_s` has passed.
        """
        if time_s > self._now_s:
            raise ClockError(
                f"Something slept until {time_s:.3f} s under the virtual clock, where time moves only between tasks.",
                fix="let a loop tick at that rate (max_tick_rate_hz), or use TimeoutLoopFactory.",
            )
