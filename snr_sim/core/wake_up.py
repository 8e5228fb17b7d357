"""Watcher thread for signals: it wakes the main thread after a signal, then checks for a stuck run until the run ends.

Python runs signal handlers between bytecodes only. A signal that arrives after that check but before the sleep system
call does not interrupt the call: `sleep(60)` would last its whole minute. So a thread reads every signal from
`signal.set_wakeup_fd`, and sends it again if its handler has not run. Sending a pending signal twice has no further
effect. After that the thread monitors the run: see `core/last_resort.py`.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

WAKE_S = 0.1  # a handler runs at once, except during a long call into C code
_NO_SIGNAL = b"\0"  # ends the thread: closing the pipe would not, while a forked child holds it
_watched: list[int] = []  # file descriptors; a forked child must not write its signals to ours


@contextmanager
def wake_on_signals(numbers: Sequence[int], handled: Sequence[object], check: Callable[[int], None]) -> Iterator[None]:
    """Wake the main thread at the first of these signals, while active. Call it from the main thread only.

    Args:
        numbers: of signals that have Python handlers.
        handled: is no longer empty once a handler has run.
        check: called periodically with the signal's number from then on, on a thread.
    """
    if not hasattr(signal, "pthread_kill"):  # Windows, where Ctrl-C ends a sleep by another mechanism
        yield
        return
    read_end, write_end = os.pipe()
    os.set_blocking(write_end, False)
    main, is_finished = threading.get_ident(), threading.Event()

    def watch() -> None:
        while (number := os.read(read_end, 1)) != _NO_SIGNAL:
            while number[0] in numbers and not is_finished.wait(WAKE_S):
                if not handled:
                    signal.pthread_kill(main, number[0])
                check(number[0])

    watcher = threading.Thread(target=watch, name="wake_up", daemon=True)
    before = signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)
    _watched.append(write_end)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        _watched.remove(write_end)
        is_finished.set()
        os.write(write_end, _NO_SIGNAL)
        watcher.join()
        os.close(write_end)
        os.close(read_end)


def _reset_after_fork() -> None:
    if _watched:
        with suppress(ValueError):
            signal.set_wakeup_fd(-1)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_reset_after_fork)
