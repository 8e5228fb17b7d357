"""Follows a signal from a thread of its own until the run has ended: wakes the main thread, and looks for a stuck run.

Python notes a signal, and looks at the note between two of its steps. One that comes after the last look and before
the kernel has put the program to sleep is noted and does not end the sleep: `sleep(60)` would sleep for its whole
minute. So a thread of its own hears of each note (`signal.set_wakeup_fd`), and sends the signal once more if nobody has
taken it. Twice noted is still one note. From then on that thread looks at the run: see `core/last_resort.py`.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

WAKE_S = 0.1  # a note is taken at once, but in a long step of a library's
_NO_SIGNAL = b"\0"  # the end is told by it: the pipe does not close while a copy of this process has it, too
_watched: list[int] = []  # file descriptors; the copy of a process would tell what it notes as if it were ours


@contextmanager
def woken_by(numbers: Sequence[int], taken: Sequence[object], look: Callable[[int], None]) -> Iterator[None]:
    """Have the main thread woken by the first of these signals, while it is entered. Only the main thread may.

    Args:
        numbers: of signals, which have handlers in Python.
        taken: is no longer empty once a handler has run.
        look: called with the first signal's number again and again from then on, on a thread.
    """
    if not hasattr(signal, "pthread_kill"):  # Windows, where Ctrl-C ends a sleep by other means
        yield
        return
    heard, noted = os.pipe()
    os.set_blocking(noted, False)
    main, is_over = threading.get_ident(), threading.Event()

    def watch() -> None:
        while (number := os.read(heard, 1)) != _NO_SIGNAL:
            while number[0] in numbers and not is_over.wait(WAKE_S):
                if not taken:
                    signal.pthread_kill(main, number[0])
                look(number[0])

    watcher = threading.Thread(target=watch, name="wake_up", daemon=True)
    before = signal.set_wakeup_fd(noted, warn_on_full_buffer=False)
    _watched.append(noted)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        _watched.remove(noted)
        is_over.set()
        os.write(noted, _NO_SIGNAL)
        watcher.join()
        os.close(noted)
        os.close(heard)


def _is_a_copy() -> None:
    if _watched:
        with suppress(ValueError):
            signal.set_wakeup_fd(-1)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_is_a_copy)
