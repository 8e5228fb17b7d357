"""Reports of a role's process to its supervisor that its node works: one a moment, as long as the node makes progress.

A thread sends them, so no component has to. An idle node polls its inbox, which counts as progress; a handler that
does not return, a process that is stopped, and C code that holds the interpreter lock all end the reports.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from snr_sim.core.node_parts import NodeParts
from snr_sim.core.standstill import progress_of

BEAT_S = 1.0
START_S = 0.05  # period of checks until the first report: a restart is complete with it
# With a shorter limit for a hang, reports are more frequent: so many per limit.
BEATS_PER_HANG = 5


def beat_period_s(hang_s: float) -> float:
    """Return the period of the reports of a process that hangs after `hang_s` without one.

    >>> beat_period_s(5.0), beat_period_s(1.0)
    (1.0, 0.2)
    """
    return min(BEAT_S, hang_s / BEATS_PER_HANG)


class Beats:
    """The reports of one node, polled.

    Args:
        node: whose progress they show. Before it has begun all its components there are none.
        send: sends "beat", then processor time used so far [s], memory [MB], and number of waiting
            tasks. Returns whether the supervisor was there to get it.
    """

    def __init__(self, node: NodeParts, send: Callable[..., bool]) -> None:
        self._node = node
        self._send = send
        self._progress: object = None

    def check(self) -> bool:
        """Send a report if the node has made progress since the last one; return whether the supervisor is there."""
        node = self._node
        progress = progress_of(node)
        machine = node.machine
        has_begun = node.inbox.wait_count or machine.executed or machine.task is not None
        if not has_begun or progress == self._progress:
            return True
        self._progress = progress
        return self._send("beat", time.process_time(), memory_mb(), node.queued_task_count)

    def run(self, period_s: float) -> None:
        """Check once a period, in a thread of its own, until the supervisor has gone."""
        while self.check():
            time.sleep(START_S if self._progress is None else period_s)


def memory_mb() -> float | None:
    """Return the memory of this process that is resident now [MB]; None where there is no /proc.

    The maximum of getrusage(2) would be at least that of the supervisor: Linux keeps it over fork and exec.
    """
    try:
        resident_pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return None
    return resident_pages * os.sysconf("SC_PAGE_SIZE") / 1e6
