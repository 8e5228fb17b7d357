"""Watchdog thread: checks a run twice a second and reports a standstill or an overload.

It only reads counters that the machines have anyway, so tasks cost no extra time and the run is unchanged. Every
runner uses `core/lockstep.py`, which starts it.

A run that stalls for `Config.stall_limit_s` (`snr run --stall-limit`) is interrupted as by a signal and ends with
`ComponentFailedError`. A loop's thread may wait for its input for any time.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from types import FrameType, TracebackType
from typing import Self

from snr_sim.core.current_call import CurrentCall, current_call
from snr_sim.core.interrupts import interrupt_main_thread
from snr_sim.core.last_resort import LastResort, write_stderr
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.overload import Overload
from snr_sim.core.standstill import Standstill
from snr_sim.prelude.errors import ComponentFailedError, SnrError

CHECK_PERIOD_S = 0.5
# Maximum time counted between two checks: a longer gap means that the whole process was stopped, not the run.
_MAX_COUNTED_S = 2 * CHECK_PERIOD_S


class Watchdog:
    """Watchdog of a run, active in a `with` block on the thread that runs it.

    Args:
        nodes: of the run.
        now_s, frames, report, pause: the clock, each thread's newest frame, the output and the sleep, as tests need.

    Attributes:
        failure: why the watchdog ended the run, if it did.
    """

    def __init__(
        self,
        nodes: Sequence[NodeParts],
        *,
        now_s: Callable[[], float] = time.monotonic,
        frames: Callable[[], Mapping[int, FrameType]] = sys._current_frames,
        report: Callable[[str], object] = write_stderr,
        pause: Callable[[float], object] = time.sleep,
    ) -> None:
        self.failure: ComponentFailedError | None = None
        self._nodes = list(nodes)
        self._now_s = now_s
        self._frames = frames
        self._report = report
        self._pause = pause
        self._limit_s = min((node.config.stall_limit_s for node in nodes), default=float("inf"))
        self._base: FrameType | None = None
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)

    def __enter__(self) -> Self:
        self.begin(sys._getframe(1))
        if self._nodes:
            # If threads cannot be started, as in a graded program, the run continues without a watchdog.
            with suppress(RuntimeError, SnrError):
                self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_over.set()
        if self._thread.ident is not None:
            self._thread.join()
        self._base = None  # breaks the reference cycle of that frame and this object

    def begin(self, base: FrameType | None) -> None:
        """Register the calling thread as the one that runs the nodes; read its stack down to the frame `base`."""
        self._thread_id = threading.get_ident()
        self._base = base
        self._checked_s = self._now_s()
        self._standstill = Standstill(self._nodes, self._call)
        self._overloads = [Overload(node, self._call, self._pause) for node in self._nodes if not node.is_in_lock_step]
        self._last_resort = LastResort(self._nodes, self._thread_id)

    def check(self) -> None:
        """Report findings, and end a run that has been at a standstill for `Config.stall_limit_s`."""
        now_s = self._now_s()
        passed_s = min(now_s - self._checked_s, _MAX_COUNTED_S)
        self._checked_s = now_s
        for message in (self._standstill.check(passed_s), *(one.check(now_s) for one in self._overloads)):
            if message is not None:
                self._report(message)
        if self.failure is not None:
            self._last_resort.check(f"after {self._limit_s:g} s", 1)
        elif self._standstill.stalled_s >= self._limit_s:
            self.failure = self._standstill.failure()
            self._standstill.node.inbox.fail(self.failure)
            interrupt_main_thread()

    def _call(self, with_task: bool) -> CurrentCall:
        return current_call(self._frames().get(self._thread_id), self._base, with_task)

    def _run(self) -> None:
        while not self._is_over.wait(CHECK_PERIOD_S):
            self.check()
