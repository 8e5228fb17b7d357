"""Report of a component that does not return: its name, what it is doing, and the student's line.

The component blocks the node's thread, so another thread (`core/watchdog.py`) detects it, and only reads. C code that
holds the interpreter lock stops that thread too.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from snr_sim.core.current_call import CurrentCall
from snr_sim.core.handlers import describe
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.source_location import after_line
from snr_sim.prelude.errors import ComponentFailedError

REPORT_AFTER_S = 2.0
REPORT_PERIOD_S = 10.0
WITHOUT_LINE_S = 10.0  # without a line of student code, report later: a device may take seconds to start
SLOW_CHECKS = 10  # consecutive checks that find the same line: the run spends its time there

_FIX = (
    "a handler, and a loop's loop(), does its work once and returns. What is to happen again is a Loop's work, at its "
    "max_tick_rate_hz; what is to happen later, a TimeoutLoopFactory's."
)


class Standstill:
    """Standstill check of a run, polled.

    Args:
        nodes: of the run; one thread runs them all.
        call: returns the current call of that thread; with True also the task that it executes.
    """

    def __init__(self, nodes: Sequence[NodeParts], call: Callable[[bool], CurrentCall]) -> None:
        self.stalled_s: float = 0.0  # wall time without any change
        self._nodes = nodes
        self._call = call
        self._state: list[Any] = []
        self._executed = -1  # tasks that the machine has not counted yet; -1 if not read
        self._report_at_s = REPORT_AFTER_S
        self._lines: deque[tuple[str, int] | None] = deque(maxlen=SLOW_CHECKS)
        self._reported_lines: set[tuple[str, int]] = set()

    def check(self, passed_s: float) -> str | None:
        """Return a report if one is due, else None; `passed_s` is the wall time since the last check."""
        state = self._progress()
        is_same = state == self._state
        call = self._call(is_same)
        is_same = is_same and self._executed in (-1, call.executed)
        self._state, self._executed = state, call.executed if is_same else -1
        self._lines.append(call.line if self.running is not None else None)
        if not is_same or call.is_debugged:
            self.stalled_s, self._report_at_s = 0.0, REPORT_AFTER_S
            return self._slow(call)
        self.stalled_s += passed_s
        if self.stalled_s < (self._report_at_s if call.frame is not None else max(self._report_at_s, WITHOUT_LINE_S)):
            return None
        self._report_at_s = self.stalled_s + REPORT_PERIOD_S
        if call.line is not None:
            self._reported_lines.add(call.line)
        return f"{self._describe(call)}, and nothing else runs meanwhile.\n  Try: {_FIX} Ctrl-C ends the run in order."

    def failure(self) -> ComponentFailedError:
        """Return the error of a run that is ended for a standstill."""
        running = self.running
        what = f"{self._describe(self._call(True))}: the run was ended."
        return ComponentFailedError(f"{what}\n  Try: {_FIX}", self.node.name, "" if running is None else running.name)

    @property
    def node(self) -> NodeParts:
        """The node that is running a component, or the first."""
        return next((node for node in self._nodes if node.machine.running is not None), self._nodes[0])

    @property
    def running(self) -> Any:
        """The component whose code runs, if one does."""
        return self.node.machine.running

    def _progress(self) -> list[Any]:
        """Return counters that change while a run makes progress. All of them exist anyway."""
        first = self._nodes[0]
        return [
            first.clock.now_s() if first.is_in_lock_step else None,
            *(
                (
                    id(node.machine.running),
                    node.machine.now_s,
                    node.machine.executed,
                    node.inbox.wait_count,
                    node.is_finished,
                )
                for node in self._nodes
            ),
        ]

    def _describe(self, call: CurrentCall) -> str:
        task = "" if call.task is None else f", which handles {describe(call.task.id())},"
        at = f"at t = {self.node.machine.now_s:.3f} s"
        return after_line(call.location, f"{self._who(call)}{task} has not returned for {self.stalled_s:.0f} s {at}")

    def _who(self, call: CurrentCall) -> str:
        function = f"{call.function}() of " if call.function else ""
        if self.running is None:  # then a plant or a scenario runs, which follow the clock
            return f"{call.function}()" if call.function else "the run"
        return f"{function}component '{self.running.name}'"

    def _slow(self, call: CurrentCall) -> str | None:
        """Return, once, a report on a line at which many checks find the run although it makes progress."""
        line = call.line
        if line is None or line in self._reported_lines or list(self._lines) != [line] * SLOW_CHECKS:
            return None
        self._reported_lines.add(line)
        return (
            f"{call.location}\n  {self._who(call)} was in this line whenever the run was looked at, {SLOW_CHECKS} "
            f"times in a row: the run spends its time there.\n  Try: {_FIX} In time.sleep() a whole run waits."
        )
