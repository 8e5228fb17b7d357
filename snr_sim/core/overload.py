"""Report of an overloaded node on the wall clock: the waiting tasks, their senders, and the slow handlers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from snr_sim.core.blame import Place
from snr_sim.core.current_call import CurrentCall
from snr_sim.core.handlers import describe
from snr_sim.core.node_life import OVERLOAD_TASKS
from snr_sim.core.node_parts import NodeParts

TOLD_AGAIN_S = 10.0
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
        self._tell_at_s = float("-inf")

    def look(self, now_s: float) -> str | None:
        """Return a report if the queue is long and was so at the last check too, else None."""
        machine = self._node.machine
        waiting = machine.queued
        if waiting < OVERLOAD_TASKS or self._node.is_over:
            self._before = None
            return None
        before = self._before
        self._before = now_s, waiting + machine.executed + self._call(True).executed
        if before is None or now_s < self._tell_at_s:
            return None
        self._tell_at_s = now_s + TOLD_AGAIN_S
        came_hz = (self._before[1] - before[1]) / max(now_s - before[0], 1e-9)
        # First in, first out: all waiting tasks arrived after the oldest one.
        oldest = f", the oldest for about {waiting / came_hz:.1f} s" if came_hz > 0 else ""
        return (
            f"{waiting} tasks wait in node '{self._node.name}'{oldest}: they come faster than their handlers work, so "
            f"handlers see old data.\n  {self._kinds()}\n  {self._makers()}\n"
            "  Try: a lower max_tick_rate_hz for what brings them, or do less in the handler."
        )

    def _kinds(self) -> str:
        kinds = Counter(describe(task.id()) for task in self._node.machine.waiting_tasks(COUNTED_TASKS))
        return f"most of them: {_shares(kinds)}"

    def _makers(self) -> str:
        sources, working = Counter[str](), Counter[str]()
        places: dict[str, Place | None] = {}
        for _ in range(SAMPLES):
            self._pause(SAMPLE_PERIOD_S)
            sources.update(source for _, source in list(self._node.door.waiting))
            running, call = self._node.machine.running, self._call(False)
            if running is not None:
                who = f"{running.name}.{call.function}" if call.function else running.name
                working[who] += 1
                places[who] = call.place or places.get(who)
        brought = f"brought by {_shares(sources)}" if sources else "returned by handlers, as far as was seen"
        if not working:
            return brought
        (slowest, _), *_ = working.most_common(1)
        where = "" if places[slowest] is None else f" ({places[slowest]})"
        return f"{brought}; the node's time goes to {_shares(working)}{where}"


def _shares(counts: Counter[str]) -> str:
    """Return the largest counts, in per cent of the total.

    >>> _shares(Counter(camera=3, depth=1))
    'camera 75 %, depth 25 %'
    """
    whole = counts.total()
    return ", ".join(f"{name} {100 * count / whole:.0f} %" for name, count in counts.most_common(SHOWN))
