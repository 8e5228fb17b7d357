"""Report of a student's code that does not return before a run: at the top level of a file, in `factories`, `__init__`.

The run's own watchdog (`core/watchdog.py`) needs its nodes, which do not exist yet.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import FrameType
from typing import Self

from snr_sim.core.current_call import current_call
from snr_sim.core.last_resort import write_stderr
from snr_sim.prelude.errors import SnrError

CHECK_PERIOD_S = 0.5
REPORT_AFTER_S = 5.0  # a large package takes some seconds to import
REPORT_PERIOD_S = 10.0

_FIX = (
    "what is at the top level of a file, in factories() and in __init__() ends at once. What is to happen again is "
    "a Loop's work, at its max_tick_rate_hz. Ctrl-C ends the program."
)


class SlowStart:
    """Watch of a start, active in a `with` block on the thread and in the function that make it.

    Args:
        now_s, frames, report: the clock, each thread's newest frame and the output, as tests need.
    """

    def __init__(
        self,
        now_s: Callable[[], float] = time.monotonic,
        frames: Callable[[], Mapping[int, FrameType]] = sys._current_frames,
        report: Callable[[str], object] = write_stderr,
    ) -> None:
        self._now_s = now_s
        self._frames = frames
        self._report = report
        self._base: FrameType | None = sys._getframe(1)  # of the caller, which is left out
        self._thread_id = threading.get_ident()
        self._since_s: float | None = None  # when it was first seen in student code
        self._report_after_s = REPORT_AFTER_S
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="slow start", daemon=True)

    def __enter__(self) -> Self:
        with suppress(RuntimeError, SnrError):  # as for the watchdog: threads may be forbidden
            self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._is_over.set()
        if self._thread.ident is not None:
            self._thread.join()
        self._base = None  # breaks the reference cycle of that frame and this object

    def check(self) -> None:
        """Report the student's line if its code has been running for too long."""
        call = current_call(self._frames().get(self._thread_id), self._base)
        if call.frame is None or call.is_debugged:
            self._since_s, self._report_after_s = None, REPORT_AFTER_S
            return
        now_s = self._now_s()
        self._since_s = now_s if self._since_s is None else self._since_s
        if now_s - self._since_s >= self._report_after_s:
            self._report_after_s += REPORT_PERIOD_S
            what = "the file" if call.function == "<module>" else f"{call.function}()"
            self._report(
                f"{call.location}\n  {what} has not returned for {now_s - self._since_s:.0f} s, so the run cannot "
                f"begin.\n  Try: {_FIX}"
            )

    def _run(self) -> None:
        while not self._is_over.wait(CHECK_PERIOD_S):
            self.check()
