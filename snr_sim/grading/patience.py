"""How long to wait for a process that owes an answer: as long as it works, and not while it waits for nothing.

A process with one thread that sleeps without a file or a disk to wait for will not wake by itself. That is seen by
what the kernel says of it, and not by a clock, so a slow computer does not make a program late.
"""

from __future__ import annotations

import time
from pathlib import Path

_IDLE_LOOKS = 6  # so many looks in a row with no work done


class Patience:
    """Counts how often a process was seen idle.

    Args:
        wall_s: the last resort: so long at most.
        pid: of the process, or of the one that has started it.
    """

    def __init__(self, wall_s: float, pid: int) -> None:
        self._give_up_s = time.monotonic() + wall_s
        self._pid = pid
        self._idle = 0
        self._worked = ""

    def is_over(self) -> bool:
        """Looks again; returns whether it is of no use to wait any longer."""
        if time.monotonic() > self._give_up_s:
            return True
        seen = _seen(self._pid)
        if seen is None:
            return False
        is_asleep, worked = seen
        self._idle = self._idle + 1 if is_asleep and worked == self._worked else 0
        self._worked = worked
        return self._idle >= _IDLE_LOOKS


def _seen(pid: int) -> tuple[bool, str] | None:
    """Returns whether all of a process and its children sleep, and their CPU time; None where nothing tells."""
    states, times = [], []
    waiting = [pid]
    while waiting:
        number = waiting.pop()
        try:
            stat = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
            children = Path(f"/proc/{number}/task/{number}/children").read_text().split()
        except OSError:
            return None
        states.append(stat[0])
        times.append(f"{number}:{stat[11]}+{stat[12]}")
        waiting += map(int, children)
    return all(state == "S" for state in states), " ".join(times)
