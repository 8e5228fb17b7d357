"""Loops: CPU cost of waiting, and the accuracy of rates on threads. The only benchmark in real time.

Run by `snr bench loops`.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from statistics import quantiles

from harness import Row

from snr_sim import Config, Loop, LoopFactory, Mode, Node, tasks

RATES_HZ = (50.0, 100.0, 500.0)
RATE_LIMIT_PERCENT = 0.2
JITTER_LIMIT_MS = 1.0


class Stamper(Loop):
    """Notes when it is called."""

    factory: StamperFactory

    def loop(self) -> None:
        self.factory.stamps_s.append(time.perf_counter())


class StamperFactory(LoopFactory):
    """Makes it, and keeps its notes."""

    def __init__(self, rate_hz: float) -> None:
        super().__init__()
        self.rate_hz = rate_hz
        self.stamps_s: list[float] = []

    def get(self, parent: Node) -> Loop:
        return Stamper(self, parent, f"stamper_{self.rate_hz:g}", self.rate_hz)


def run_for(factories: Sequence[LoopFactory], wall_s: float) -> float:
    """Run a node on the wall clock for a while; return the CPU time the process took meanwhile [s]."""
    node = Node("bench", Config(Mode.TEST, {"bench": list(factories)}))
    thread = threading.Thread(target=node.loop)
    thread.start()
    time.sleep(0.1)  # starting is not what is measured
    start_s = time.process_time()
    time.sleep(wall_s)
    cpu_s = time.process_time() - start_s
    node.enqueue_input(tasks.terminate("enough"), "bench")
    thread.join()
    return cpu_s


def bare_stamps(rate_hz: float, wall_s: float) -> list[float]:
    """Note the time on deadlines that `time.sleep` keeps, without a node: what this machine can do now."""
    stamps = [time.perf_counter()]
    start_s = stamps[0]
    while stamps[-1] - start_s < wall_s:
        time.sleep(max(0.0, start_s + len(stamps) / rate_hz - time.perf_counter()))
        stamps.append(time.perf_counter())
    return stamps


def rate_error_percent(stamps_s: Sequence[float], rate_hz: float) -> float:
    """Return the deviation of the mean rate from the requested one."""
    mean_hz = (len(stamps_s) - 1) / (stamps_s[-1] - stamps_s[0])
    return abs(mean_hz / rate_hz - 1.0) * 100.0


def jitter_ms(stamps_s: Sequence[float], rate_hz: float) -> float:
    """Return the 99th percentile of the deviation of a period from the requested one."""
    errors = [abs(b - a - 1.0 / rate_hz) for a, b in pairwise(stamps_s)]
    return 1e3 * quantiles(errors, n=100)[-1]


def alone(measured: Callable[[Sequence[float], float], float], rate_hz: float, wall_s: float) -> float:
    """Return what a bare sleeping loop reaches at the rate."""
    return measured(bare_stamps(rate_hz, wall_s), rate_hz)


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    wall_s = 1.0 if is_quick else 10.0
    share = 100.0 * run_for([], wall_s) / wall_s
    yield Row("idle node", share, "% CPU", limit=1.0, note="an empty node that waits at its inbox")
    factories = [StamperFactory(rate_hz) for rate_hz in RATES_HZ]
    run_for(factories, wall_s)
    for factory in factories:
        rate_hz, stamps_s = factory.rate_hz, factory.stamps_s
        yield Row(
            f"thread loop at {rate_hz:g} Hz, mean rate",
            rate_error_percent(stamps_s, rate_hz),
            "% off",
            limit=RATE_LIMIT_PERCENT,
            baseline=alone(rate_error_percent, rate_hz, 0.3 * wall_s),
            compared_to="bare time.sleep",
            note=f"over {wall_s:g} s, all three loops in one node",
        )
        yield Row(
            f"thread loop at {rate_hz:g} Hz, p99 of period error",
            jitter_ms(stamps_s, rate_hz),
            "ms",
            limit=JITTER_LIMIT_MS,
            baseline=alone(jitter_ms, rate_hz, 0.3 * wall_s),
            compared_to="bare time.sleep",
        )
