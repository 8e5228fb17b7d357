"""What a student's process does to itself before it reads the submission: gives rights away, and takes limits on."""

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

from snr_sim.grading.remote.protocol import TIME_UP_STATUS
from snr_sim.prelude.errors import SnrError

_PARENT_DEATH_SIGNAL = 1  # prctl
_GRACE_S = 0.5  # of CPU time, to end after the time is up
_LOOK_S = 0.05
_HAS_TIMER = hasattr(signal, "setitimer")  # Windows has none
# The time for one thing, and for all; without these a thread calls the handler of a signal that exists everywhere.
_TIME_UP = (signal.SIGPROF, signal.SIGXCPU) if _HAS_TIMER else (signal.SIGTERM,)


class TookTooLong(BaseException):
    """Raised where the student's program is when its CPU time is up; nothing of Python's own catches it."""


def become(user: int) -> None:
    """Becomes this user, for good."""
    os.setgroups([])
    os.setresgid(user, user, user)
    os.setresuid(user, user, user)  # with it all of root's rights are gone, for good


def end_with_parent() -> None:
    """Have the kernel kill this process when the thread that started it ends; on Linux only.

    A change of the user takes it back.
    """
    if sys.platform == "linux":
        process_control(_PARENT_DEATH_SIGNAL, signal.SIGKILL)


def process_control(option: int, value: int) -> None:
    """Call prctl.

    Raises:
        OSError: the kernel refuses it.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(option, ctypes.c_ulong(value), ctypes.c_ulong(0), ctypes.c_ulong(0), ctypes.c_ulong(0)) != 0:
        raise OSError(ctypes.get_errno(), "prctl")


def limit(limits: tuple[int, int, int, int], is_alone: bool) -> None:
    """Takes limits on; they can only be lowered from here.

    Args:
        limits: seconds of CPU time, bytes of memory, bytes of a file, open files.
        is_alone: whether nobody else runs as its user, so that it may start nothing.
    """
    if not _HAS_TIMER:
        _Timer.start()
        return  # Windows has none of these
    import resource

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


def refuse_company() -> None:
    """Has threads refused with a reason, and sleeps return at once: time is virtual here."""
    threading.Thread.start = _start_nothing  # type: ignore[assignment]
    time.sleep = _do_not_sleep  # type: ignore[assignment]


def heed_time() -> None:
    """Has `TookTooLong` raised where the program is when a signal says that its time is up."""
    for up in _TIME_UP:
        signal.signal(up, _time_is_up)


def bound_time(cpu_s: float) -> None:
    """Have the time be up after so much more CPU time; 0 ends the bound."""
    if _HAS_TIMER:
        signal.setitimer(signal.ITIMER_PROF, cpu_s, _GRACE_S if cpu_s else 0.0)
    else:
        _Timer.up_s = time.process_time() + cpu_s if cpu_s else math.inf


class _Timer:
    """What a thread knows that does the same where the system has no timer of CPU time."""

    up_s = math.inf

    @classmethod
    def start(cls) -> None:
        threading.Thread(target=cls._run, daemon=True).start()

    @classmethod
    def _run(cls) -> None:
        while True:
            threading.Event().wait(_LOOK_S)  # `time.sleep` returns at once here
            if time.process_time() > cls.up_s:
                cls.up_s += _GRACE_S
                if signal.getsignal(*_TIME_UP) is signal.SIG_DFL:  # it was told, and goes on
                    os._exit(TIME_UP_STATUS)
                _thread.interrupt_main(*_TIME_UP)


def _time_is_up(number: int, frame: FrameType | None) -> None:
    """Says so where the program is; if it goes on all the same, ends it."""
    signal.signal(number, signal.SIG_DFL)
    raise TookTooLong("this takes too long: its CPU time is used up")


def _start_nothing(thread: threading.Thread) -> None:
    raise SnrError(
        f"A thread '{thread.name}' was to be started, but a graded program has one only.",
        fix="let a Loop do it: in lock step the clock calls it.",
    )


def _do_not_sleep(seconds: float) -> None:
    """Returns at once."""
