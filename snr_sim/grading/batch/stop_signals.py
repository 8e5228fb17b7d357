"""SIGINT and SIGTERM of a grader: they end its waiting, and leave its cleanup alone."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_NUMBERS = (signal.SIGINT, signal.SIGTERM)


class StopSignals:
    """SIGINT and SIGTERM, deferred while it is entered: the first is handled in `interruptible()`, or at the end.

    Python runs a signal handler between any two bytecodes of the main thread. An exception raised there can skip a
    cleanup, or lose a folder that was just made. So the handlers that were there before are called only where that
    does no harm, and only once: a second Ctrl-C does not interrupt the cleanup after the first.

    Signals without a handler in Python are left alone. In other threads than the main one this does nothing.
    """

    def __init__(self) -> None:
        self._before: dict[int, Callable[[int, FrameType | None], Any]] = {}
        self._received: list[int] = []
        self._is_interruptible = False
        self._is_handled = False

    def __enter__(self) -> StopSignals:
        if threading.current_thread() is threading.main_thread():
            for number in _NUMBERS:
                handler = signal.getsignal(number)
                if callable(handler):
                    self._before[number] = handler
                    signal.signal(number, self._on_signal)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if kind is None:
            self._handle_first()

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """Handle the signal that was deferred, or the first that arrives while this is entered.

        Python's own handler of SIGINT, and that of `snr`, raise KeyboardInterrupt.
        """
        try:
            self._is_interruptible = True  # before the check, so that no signal falls between the two
            self._handle_first()
            yield
        finally:
            self._is_interruptible = False

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self._received.append(number)
        if self._is_interruptible:
            self._handle_first()

    def _handle_first(self) -> None:
        if self._received and not self._is_handled:
            self._is_handled = True
            self._before[self._received[0]](self._received[0], None)
