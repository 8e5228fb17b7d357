"""What a student's process does to itself before it reads the submission: drops privileges and sets limits."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time

from snr_sim.prelude.errors import SnrError

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
    """Call prctl.

    Raises:
        OSError: the kernel refuses it.
    """
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
