"""Report of an overloaded node on the wall clock: the waiting tasks, their senders, and the slow handlers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from snr_sim.core.current_call import CurrentCall
from snr_sim.core.handlers import describe
from snr_sim.core.node_life import OVERLOAD_TASKS
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.source_location import SourceLocation

REPORT_PERIOD_S = 10.0
SAMPLES = 40  # of senders and of running handlers, for one report
SAMPLE_PERIOD_S = 0.005
COUNTED_TASKS = 10_000  # at most, of the waiting tasks
SHOWN = 3


class Overload:
    """Overload check of one node, polled from another thread than the node's.

    Args:
        node: on the wall clock.
        call: returns the current call of the node's thread; with True also the number of tasks executed in it.
        pause: waits the given seconds.
    """

    def __init__(self, node: NodeParts, call: Callable[[bool], CurrentCall], pause: Callable[[float], object]) -> None:
        self._node = node
        self._call = call
        self._pause = pause
        self._before: tuple[float, int] | None = None  # time of the last check [s], and total number of tasks by then
        self._report_at_s = float("-inf")

    def check(self, now_s: float) -> str | None:
        """Return a report if the queue is long and was so at the last check too, else None."""
        machine = self._node.machine
        waiting = machine.queued
        if waiting < OVERLOAD_TASKS or self._node.is_finished:
            self._before = None
            return None
        before = self._before
        self._before = now_s, waiting + machine.executed + self._call(True).executed
        if before is None or now_s < self._report_at_s:
            return None
        self._report_at_s = now_s + REPORT_PERIOD_S
        arrival_hz = (self._before[1] - before[1]) / max(now_s - before[0], 1e-9)
        # First in, first out: all waiting tasks arrived after the oldest one.
        oldest = f", the oldest for about {waiting / arrival_hz:.1f} s" if arrival_hz > 0 else ""
        return (
            f"{waiting} tasks wait in node '{self._node.name}'{oldest}: they come faster than their handlers work, so "
            f"handlers see old data.\n  {self._kinds()}\n  {self._senders()}\n"
            "  Try: a lower max_tick_rate_hz for what brings them, or do less in the handler."
        )

    def _kinds(self) -> str:
        kinds = Counter(describe(task.id()) for task in self._node.machine.waiting_tasks(COUNTED_TASKS))
        return f"most of them: {_percentages(kinds)}"

    def _senders(self) -> str:
        sources, working = Counter[str](), Counter[str]()
        locations: dict[str, SourceLocation | None] = {}
        for _ in range(SAMPLES):
            self._pause(SAMPLE_PERIOD_S)
            sources.update(source for _, source in list(self._node.inbox.waiting))
            running, call = self._node.machine.running, self._call(False)
            if running is not None:
                who = f"{running.name}.{call.function}" if call.function else running.name
                working[who] += 1
                locations[who] = call.location or locations.get(who)
        brought = f"brought by {_percentages(sources)}" if sources else "returned by handlers, as far as was seen"
        if not working:
            return brought
        (slowest, _), *_ = working.most_common(1)
        where = "" if locations[slowest] is None else f" ({locations[slowest]})"
        return f"{brought}; the node's time goes to {_percentages(working)}{where}"


def _percentages(counts: Counter[str]) -> str:
    """Return the largest counts, in per cent of the total.

    >>> _percentages(Counter(camera=3, depth=1))
    'camera 75 %, depth 25 %'
    """
    whole = counts.total()
    return ", ".join(f"{name} {100 * count / whole:.0f} %" for name, count in counts.most_common(SHOWN))
