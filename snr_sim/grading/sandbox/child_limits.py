"""What a student's process does to itself before it reads the submission: drops privileges and sets limits.

The limit of CPU time interrupts the program where it is, so that the report names the line. A program that ignores the
interrupt is ended by the kernel's limit, or by the grader (`remote/cpu_timeout.py`).
"""

from __future__ import annotations

import _thread
import ctypes
import math
import os
import signal
import sys
import threading
import time
from types import FrameType

from snr_sim.prelude.errors import SnrError

TIME_UP_STATUS = 152  # exit status of a process whose CPU time is used up, as a shell reports SIGXCPU
_GRACE_S = 0.5  # of CPU time, to end after the time is up
_POLL_PERIOD_S = 0.05
_HAS_TIMER = hasattr(signal, "setitimer")  # Windows has none
# The time for one thing, and for all; without these a thread calls the handler of a signal that exists everywhere.
_TIME_UP = (signal.SIGPROF, signal.SIGXCPU) if _HAS_TIMER else (signal.SIGTERM,)
_PARENT_DEATH_SIGNAL = 1  # prctl


def drop_privileges(user: int) -> None:
    """Become this user, for good: with it all of root's rights are gone."""
    os.setgroups([])
    os.setresgid(user, user, user)
    os.setresuid(user, user, user)


def end_with_parent() -> None:
    """Have the kernel kill this process when the thread that started it ends; on Linux only.

    A change of the user resets it.
    """
    if sys.platform == "linux":
        process_control(_PARENT_DEATH_SIGNAL, signal.SIGKILL)


def process_control(option: int, value: int) -> None:
    """Call prctl; raise OSError if the kernel refuses it."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(option, ctypes.c_ulong(value), ctypes.c_ulong(0), ctypes.c_ulong(0), ctypes.c_ulong(0)) != 0:
        raise OSError(ctypes.get_errno(), "prctl")


def limit(limits: tuple[int, int, int, int], is_alone: bool) -> None:
    """Set limits, which can only be lowered from here. Windows has none of them.

    Args:
        limits: seconds of CPU time, bytes of memory, bytes of a file, open files.
        is_alone: whether no other process runs as its user, so that it may start nothing.
    """
    try:
        import resource
    except ImportError:
        return
    cpu_s, memory_bytes, file_bytes, open_files = limits
    hard = {
        resource.RLIMIT_CPU: (cpu_s, cpu_s + 2),
        resource.RLIMIT_AS: (memory_bytes, memory_bytes),
        resource.RLIMIT_FSIZE: (file_bytes, file_bytes),
        resource.RLIMIT_NOFILE: (open_files, open_files),
        resource.RLIMIT_CORE: (0, 0),
    }
    if is_alone:  # else this would count all that the student runs on this computer
        hard[resource.RLIMIT_NPROC] = (1, 1)
    for name, value in hard.items():
        try:
            resource.setrlimit(name, value)
        except (OSError, ValueError):
            if is_alone:
                raise


def forbid_threads() -> None:
    """Have threads refused with a reason, and sleeps return at once: time is virtual here."""
    threading.Thread.start = _reject_start  # type: ignore[assignment]
    time.sleep = lambda seconds: None


def _reject_start(thread: threading.Thread) -> None:
    raise SnrError(
        f"A thread '{thread.name}' cannot be started: a graded program has one thread only.",
        fix="use a Loop instead: in lock step the clock calls it.",
    )


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


def _time_is_up(number: int, _frame: FrameType | None) -> None:
    """Raise in the running program; if that does not stop it, the next signal ends the process."""
    signal.signal(number, signal.SIG_DFL)
    raise CpuTimeExceeded("this takes too long: its CPU time is used up")
