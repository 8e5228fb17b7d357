"""Report of an overloaded node on the wall clock: the waiting tasks, their senders, and the slow handlers.

Tasks that schedule each other without end keep the queue short, but the node is never idle and executes many more tasks
than come from outside. In lock step `core/runaway.py` ends such a run; a robot on the wall clock continues.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from snr_sim.core.current_call import CurrentCall
from snr_sim.core.handlers import describe
from snr_sim.core.node_life import OVERLOAD_TASKS
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.runaway import ENDLESS_FIX
from snr_sim.core.source_location import SourceLocation, after_line, location_of

REPORT_PERIOD_S = 10.0
SAMPLES = 40  # of senders and of running handlers, for one report
SAMPLE_PERIOD_S = 0.005
COUNTED_TASKS = 10_000  # at most, of the waiting tasks
SHOWN = 3
ENDLESS_AFTER_S = 2.0  # without a pause, and with at least so many tasks, and so many for each input
MIN_ENDLESS_TASKS = 1000
MIN_TASKS_PER_INPUT = 100


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
        # Since the node was idle last: its number of waits, the time [s], and executed tasks and inputs by then.
        self._busy_since: tuple[int, float, int, int] = (-1, 0.0, 0, 0)

    def check(self, now_s: float) -> str | None:
        """Return a report if the queue is long and was so at the last check too, or tasks have no end; else None."""
        return self._check_queue(now_s) or self._check_endless(now_s)

    def _check_endless(self, now_s: float) -> str | None:
        machine, wait_count = self._node.machine, self._node.inbox.wait_count
        if wait_count != self._busy_since[0] or self._node.is_finished:
            self._busy_since = wait_count, now_s, machine.executed, machine.accepted
            return None
        _, since_s, executed, accepted = self._busy_since
        if now_s - since_s < ENDLESS_AFTER_S or now_s < self._report_at_s:
            return None
        executed = machine.executed + self._call(True).executed - executed
        inputs = machine.accepted - accepted
        if executed < max(MIN_ENDLESS_TASKS, MIN_TASKS_PER_INPUT * inputs):
            return None
        self._report_at_s = now_s + REPORT_PERIOD_S
        what = (
            f"node '{self._node.name}' has executed {executed} tasks in {now_s - since_s:.1f} s without a pause, and "
            f"{inputs} came from outside: tasks schedule each other without end."
        )
        first, lines = self._repeated()
        return "\n  ".join([after_line(first, what), *lines, f"Try: {ENDLESS_FIX}"])

    def _repeated(self) -> tuple[SourceLocation | None, list[str]]:
        """Return the first student's line of the handlers of some executed tasks, and a text for each task."""
        lines: dict[str, str] = {}
        first: SourceLocation | None = None
        for _ in range(SAMPLES):
            self._pause(SAMPLE_PERIOD_S)
            task = self._call(True).task
            if task is None or describe(task.id()) in lines or len(lines) == SHOWN:
                continue
            called = []
            for _, handler, _, label in self._node.machine.lookup.cache[task.type].get(task.name, ()):
                location = location_of(handler)
                first = first or location
                called.append(".".join(label) + (f" ({location})" if location else ""))
            lines[describe(task.id())] = f"  {describe(task.id())} -> {', '.join(called)}"
        return first, list(lines.values())

    def _check_queue(self, now_s: float) -> str | None:
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
