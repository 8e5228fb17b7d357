"""Ctrl-C and SIGTERM outside of a run, where they interrupt `snr`. Within a run see `core/interrupts.py`."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

_STUCK_S = 2.0  # as in a run: see core/interrupts.py, which is slow to import
stopped_by: list[int] = []  # numbers of the received signals


def interrupt_at_signals() -> None:
    """Let SIGTERM, and Ctrl-C unless it is ignored, raise KeyboardInterrupt with the signal's number.

    A student's file that is imported, or a handler that is replayed, may swallow the exception. If the program is
    still in it two seconds later, the process is ended.
    """
    signal.signal(signal.SIGTERM, _interrupt)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)


def status() -> int:
    """Return the exit status of a program that a signal has interrupted, and stop watching it."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0)
    return 128 + (stopped_by[0] if stopped_by else signal.SIGINT)


def end_by_default() -> None:
    """Let signals end the process at once from now on: only a student's threads and exit functions remain."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is _interrupt:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def signals_call(function: Callable[[], object]) -> Iterator[None]:
    """Let the first of these signals call a function, and not raise, while active.

    For asyncio: an exception between two of its callbacks loses one of them, and the task behind it never ends.
    """
    numbers = [one for one in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(one) is _interrupt]

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        restore()
        function()

    def restore() -> None:
        for number in numbers:
            signal.signal(number, _interrupt)

    for number in numbers:
        signal.signal(number, on_signal)
    try:
        yield
    finally:
        restore()


def _interrupt(number: int, _frame: FrameType | None) -> None:
    stopped_by.append(number)
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _end_if_stuck)
        signal.setitimer(signal.ITIMER_REAL, _STUCK_S)
    raise KeyboardInterrupt(number)


def _end_if_stuck(_number: int, frame: FrameType | None) -> None:
    from snr_sim.core.interrupts import write_stderr
    from snr_sim.core.source_location import INTERRUPT_FIX, current_location

    place = None if frame is None else current_location(frame)
    if place is None:  # snr_sim itself is still working, or waits for an answer
        return
    name = signal.Signals(stopped_by[0]).name
    write_stderr(
        f"{place}\n  {name}: this did not return, although it was interrupted.\n"
        f"  After {_STUCK_S:g} s the process was ended.\n  Try: {INTERRUPT_FIX}"
    )
    os._exit(128 + stopped_by[0])
