"""Watchdog thread: checks a run twice a second and reports a standstill or an overload.

It only reads counters that the machines have anyway, so tasks cost no extra time and the run is unchanged. Every
runner uses `core/lockstep.py`, which starts it.

A run that stalls for `Config.stall_limit_s` (`snr run --stall-limit`) is interrupted as by a signal and ends with
`ComponentFailedError`. A loop's thread may wait for its input for any time.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from types import FrameType, TracebackType
from typing import Self

from snr_sim.core.handlers import describe
from snr_sim.core.interrupts import LastResort, interrupt_main_thread, write_stderr
from snr_sim.core.node_life import OVERLOAD_TASKS
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.runaway import ENDLESS_FIX
from snr_sim.core.source_location import SourceLocation, after_line, location_of
from snr_sim.core.standstill import CurrentCall, Standstill, current_call
from snr_sim.prelude.errors import ComponentFailedError, SnrError

CHECK_PERIOD_S = 0.5
# Maximum time counted between two checks: a longer gap means that the whole process was stopped, not the run.
_MAX_COUNTED_S = 2 * CHECK_PERIOD_S
REPORT_PERIOD_S = 10.0
SAMPLES = 40  # of senders and of running handlers, for one report
SAMPLE_PERIOD_S = 0.005
COUNTED_TASKS = 10_000  # at most, of the waiting tasks
SHOWN = 3
ENDLESS_AFTER_S = 2.0  # without a pause, and with at least so many tasks, and so many for each input
MIN_ENDLESS_TASKS = 1000
MIN_TASKS_PER_INPUT = 100
UNENDED_AFTER_S = 10.0


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


class Unended:
    """Check of nodes in lock step without a time limit: when some have ended, the others may never do so.

    Args:
        nodes: of the run.
    """

    def __init__(self, nodes: Sequence[NodeParts]) -> None:
        self._nodes = nodes
        self._since_s: float | None = None  # when the first one was seen to have ended [s]
        self._is_reported = False

    def check(self, now_s: float) -> str | None:
        """Return a report, once, if some nodes still run `UNENDED_AFTER_S` after another one has ended; else None."""
        ended = [node.role for node in self._nodes if node.is_terminated]
        left = [node for node in self._nodes if not node.is_terminated]
        if self._is_reported or not (ended and left):
            return None
        self._since_s = now_s if self._since_s is None else self._since_s
        if now_s - self._since_s < UNENDED_AFTER_S:
            return None
        self._is_reported = True
        others = " and ".join(f"'{node.role}'" for node in left)
        return (
            f"Role '{ended[0]}' has ended, and {others} still {'runs' if len(left) == 1 else 'run'}, now at "
            f"t = {left[0].clock.now_s():.0f} s of simulated time: the run ends when all have.\n"
            "  Try: tasks.terminate('why') in each role, or a time limit: SimRunner(..., until_s=60.0)."
        )


class Watchdog:
    """Watchdog of a run, active in a `with` block on the thread that runs it.

    Args:
        nodes: of the run.
        is_endless: whether they are in lock step, and no time limit ends them.
        now_s, report, pause: the clock, the output and the sleep, as tests need.

    Attributes:
        failure: why the watchdog ended the run, if it did.
    """

    def __init__(
        self,
        nodes: Sequence[NodeParts],
        *,
        is_endless: bool = False,
        now_s: Callable[[], float] = time.monotonic,
        report: Callable[[str], object] = write_stderr,
        pause: Callable[[float], object] = time.sleep,
    ) -> None:
        self.failure: ComponentFailedError | None = None
        self._nodes = list(nodes)
        self._unended = Unended(self._nodes if is_endless else [])
        self._now_s = now_s
        self._report = report
        self._pause = pause
        self._limit_s = min((node.config.stall_limit_s for node in nodes), default=float("inf"))
        self._base: FrameType | None = None
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)

    def __enter__(self) -> Self:
        self.begin(sys._getframe(1))
        if self._nodes:
            # If threads cannot be started, as in a graded program, the run continues without a watchdog.
            with suppress(RuntimeError, SnrError):
                self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_over.set()
        if self._thread.ident is not None:
            self._thread.join()
        self._base = None  # breaks the reference cycle of that frame and this object

    def begin(self, base: FrameType | None) -> None:
        """Register the calling thread as the one that runs the nodes; read its stack down to the frame `base`."""
        self._thread_id = threading.get_ident()
        self._base = base
        self._checked_s = self._now_s()
        self._standstill = Standstill(self._nodes, self._call)
        self._overloads = [Overload(node, self._call, self._pause) for node in self._nodes if not node.is_in_lock_step]
        self._last_resort = LastResort(self._nodes, self._thread_id)

    def check(self) -> None:
        """Report findings, and end a run that has been at a standstill for `Config.stall_limit_s`."""
        now_s = self._now_s()
        passed_s = min(now_s - self._checked_s, _MAX_COUNTED_S)
        self._checked_s = now_s
        for message in (
            self._standstill.check(passed_s),
            self._unended.check(now_s),
            *(one.check(now_s) for one in self._overloads),
        ):
            if message is not None:
                self._report(message)
        if self.failure is not None:
            self._last_resort.check(f"after {self._limit_s:g} s", 1)
        elif self._standstill.stalled_s >= self._limit_s:
            self.failure = self._standstill.failure()
            self._standstill.node.inbox.fail(self.failure)
            interrupt_main_thread()

    def _call(self, with_task: bool) -> CurrentCall:
        return current_call(sys._current_frames().get(self._thread_id), self._base, with_task)

    def _run(self) -> None:
        while not self._is_over.wait(CHECK_PERIOD_S):
            self.check()
