"""CPU time limit inside a student's process: interrupts the program where it is, so that the report names the line.

A program that ignores the interrupt is ended by the kernel's limit (`child_limits.py`) or by `cpu_timeout.py`.
"""

from __future__ import annotations

import _thread
import math
import os
import signal
import threading
import time
from types import FrameType

from snr_sim.grading.remote.protocol import TIME_UP_STATUS

_GRACE_S = 0.5  # of CPU time, to end after the time is up
_POLL_PERIOD_S = 0.05
_HAS_TIMER = hasattr(signal, "setitimer")  # Windows has none
# The time for one thing, and for all; without these a thread calls the handler of a signal that exists everywhere.
_TIME_UP = (signal.SIGPROF, signal.SIGXCPU) if _HAS_TIMER else (signal.SIGTERM,)


class CpuTimeExceeded(BaseException):
    """Raised in the student's program when its CPU time is used up; `except Exception` does not catch it."""


def start_timer() -> None:
    """Start the CPU time counter where the system has no such timer, while threads may still be started."""
    if not _HAS_TIMER:
        threading.Thread(target=_Timer.run, daemon=True).start()


def install_timer_handler() -> None:
    """Have a signal for used-up CPU time raise `CpuTimeExceeded` in the running program."""
    for up in _TIME_UP:
        signal.signal(up, _time_is_up)


def limit_cpu_time(cpu_s: float) -> None:
    """Set the CPU time limit from now on; 0 removes it."""
    if _HAS_TIMER:
        signal.setitimer(signal.ITIMER_PROF, cpu_s, _GRACE_S if cpu_s else 0.0)
    else:
        _Timer.up_s = time.process_time() + cpu_s if cpu_s else math.inf


class _Timer:
    """Thread that does the same where the system has no timer of CPU time."""

    up_s = math.inf

    @classmethod
    def run(cls) -> None:
        while True:
            threading.Event().wait(_POLL_PERIOD_S)  # `time.sleep` returns at once here
            if time.process_time() > cls.up_s:
                cls.up_s += _GRACE_S
                if signal.getsignal(*_TIME_UP) is signal.SIG_DFL:  # it was interrupted before, and still runs
                    os._exit(TIME_UP_STATUS)
                _thread.interrupt_main(*_TIME_UP)


def _time_is_up(number: int, frame: FrameType | None) -> None:
    """Raise in the running program; if that does not stop it, the next signal ends the process."""
    signal.signal(number, signal.SIG_DFL)
    raise CpuTimeExceeded("this takes too long: its CPU time is used up")
