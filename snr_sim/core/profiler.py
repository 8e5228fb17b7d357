"""Profiler: durations of each handler and each loop, over the whole run and not only its last calls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from time import perf_counter
from typing import Any, ParamSpec, TypeVar

from snr_sim.prelude.retired import Retired

P = ParamSpec("P")
R = TypeVar("R")


@dataclass
class Timing:
    """Durations of the calls of one handler or loop, in seconds of wall time."""

    count: int = 0
    total_s: float = 0.0
    max_s: float = 0.0

    @property
    def mean_s(self) -> float:
        """Mean of all calls."""
        return self.total_s / self.count if self.count else 0.0


class Profiler:
    """Timings by name, such as 'pad.on_inertial' or 'radar_loop.loop'.

    >>> profiler = Profiler()
    >>> profiler.time("add", lambda a, b: a + b, 1, 2)
    3
    >>> profiler.timings["add"].count
    1
    """

    is_alive: Any = Retired("profiler.is_alive", "leave it out: it has no thread.")
    join_from: Any = Retired("profiler.join_from", "leave it out: it has no thread.")

    def __init__(self) -> None:
        self.timings: dict[str, Timing] = {}

    def time(self, name: str, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Call the function, add its duration to `name`, and return its result."""
        start_s = perf_counter()
        try:
            return function(*args, **kwargs)
        finally:
            self.store_task(name, perf_counter() - start_s)

    def timed(self, name: str, function: Callable[P, R]) -> Callable[P, R]:
        """Return the function, wrapped so that the duration of each call is added to `name`."""

        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            return self.time(name, function, *args, **kwargs)

        return call

    def store_task(self, name: str, duration_s: float) -> None:
        """Add one call to `name`."""
        timing = self.timings.get(name)
        if timing is None:
            timing = self.timings[name] = Timing()
        timing.count += 1
        timing.total_s += duration_s
        timing.max_s = max(timing.max_s, duration_s)

    def rows(self) -> list[dict[str, float | str]]:
        """Return name, count, total, mean and max [s] and fraction of the measured time; most expensive first."""
        whole_s = sum(timing.total_s for timing in self.timings.values()) or 1.0  # decides no run: only printed
        by_cost = sorted(self.timings.items(), key=lambda item: -item[1].total_s)
        return [
            {
                "name": name,
                "count": timing.count,
                "total_s": timing.total_s,
                "mean_s": timing.mean_s,
                "max_s": timing.max_s,
                "share": timing.total_s / whole_s,
            }
            for name, timing in by_cost
        ]

    def dump(self) -> str:
        """Return the rows as a table in text."""
        lines = [f"{'':32} {'calls':>9} {'total ms':>10} {'mean us':>10} {'max us':>10} {'share':>7}"]
        for row in self.rows():
            total_us, mean_us, max_us = (float(row[key]) * 1e6 for key in ("total_s", "mean_s", "max_s"))
            lines.append(
                f"{row['name']:32} {row['count']:>9} {total_us / 1e3:>10.2f} {mean_us:>10.2f} {max_us:>10.2f} "
                f"{row['share']:>7.1%}"
            )
        return "\n".join(lines)
