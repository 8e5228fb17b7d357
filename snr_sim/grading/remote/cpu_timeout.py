"""Timeout for a process that owes an answer: it may use all of its CPU time, as long as it does something.

A process with one thread that sleeps and waits for neither a file nor a disk will not wake by itself. The kernel's
process state shows this, not a clock, so a slow computer does not time a program out.
"""

from __future__ import annotations

import os
import select
import socket
import time
from pathlib import Path

END_TIMEOUT_S = 2.0
POLL_PERIOD_S = 0.5  # so often, and no oftener, it is looked at whether a process that does not answer is working
_MAX_IDLE_POLLS = 6  # consecutive checks without CPU time used
# A program that has just printed was interrupted by the grader's reading it, above all on the core that they share
# (`batch/workers.py`): it is not asleep then, and is looked at again, so often, until this time is over.
_AGAIN_PERIOD_S, _AGAIN_S = 0.02, 0.1
_SLACK_S = 2.0
_TICKS_HZ = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 0  # of /proc, which Windows has not


class CpuTimeout:
    """Timeout of one answer, which checks the process periodically.

    Args:
        wall_s: wall time as the last resort, in seconds.
        cpu_s: CPU time limit in seconds. The process enforces it too; this checks that it does.
        pid: of the process, or of the one that has started it.
    """

    def __init__(self, wall_s: float, cpu_s: float, pid: int) -> None:
        now_s = time.monotonic()
        self._deadline_s = now_s + wall_s
        self._next_poll_s = now_s + 0.9 * POLL_PERIOD_S
        self._cpu_s = cpu_s + _SLACK_S
        self._pid = pid
        self._idle = 0
        self._first_s: float | None = None
        self._cpu_time_s = 0.0
        self.is_cpu_used_up: bool = False  # whether its CPU time was used up
        self.poll_period_s: float = POLL_PERIOD_S  # time until `is_over` should be asked again

    def is_over(self) -> bool:
        """Check again, unless the last check was just now; return whether waiting longer is useless."""
        now_s = time.monotonic()
        if now_s > self._deadline_s:
            return True
        if now_s < self._next_poll_s:
            return False
        state = process_state(self._pid)
        if state is not None and not state[0] and now_s < self._next_poll_s + _AGAIN_S:
            self.poll_period_s = _AGAIN_PERIOD_S
            return False
        self.poll_period_s = POLL_PERIOD_S
        self._next_poll_s = now_s + 0.9 * POLL_PERIOD_S
        if state is None:
            return False
        is_asleep, cpu_time_s = state
        self._idle = self._idle + 1 if is_asleep and cpu_time_s == self._cpu_time_s else 0
        self._cpu_time_s = cpu_time_s
        self._first_s = cpu_time_s if self._first_s is None else self._first_s
        self.is_cpu_used_up = cpu_time_s - self._first_s > self._cpu_s
        return self.is_cpu_used_up or self._idle >= _MAX_IDLE_POLLS


def process_state(pid: int) -> tuple[bool, float] | None:
    """Return whether a process and all its children sleep, and their CPU time in s; None where /proc lacks it."""
    if not _TICKS_HZ:
        return None
    are_asleep, ticks = True, 0
    waiting = [pid]
    while waiting:
        number = waiting.pop()
        try:
            stat = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
            children = Path(f"/proc/{number}/task/{number}/children").read_text().split()
        except OSError:
            return None
        are_asleep = are_asleep and stat[0] in "ST"  # asleep, or stopped
        ticks += int(stat[11]) + int(stat[12])
        waiting += map(int, children)
    return are_asleep, ticks / _TICKS_HZ


def wait_for_hangup(line: socket.socket) -> None:
    """Wait until no process is left at the far end of a line."""
    far_end = select.poll()
    far_end.register(line, 0)  # poll() always reports a hang-up
    far_end.poll(END_TIMEOUT_S * 1000.0)
