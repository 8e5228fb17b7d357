"""Executor of a loop on the wall clock: a thread. That of the virtual clock is in `core/clocks.py`."""

from __future__ import annotations

import sys
import threading
import time
from contextlib import suppress

from snr_sim.core.loop import Loop, WakingPages
from snr_sim.core.node_life import NodeLife
from snr_sim.core.source_location import current_location
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.prelude.task import DataKey, Page, SomeTasks, Task

# In periods of the loop's rate: the minimum time from the last tick to one requested by `wake`, and how long the tick
# after that waits for the next `wake`. A loop that gets one `wake` per period then ticks at these calls: neither
# twice per period, nor with a growing delay.
_MIN_WAKE_PERIODS, _MAX_WAKE_WAIT_PERIODS = 0.5, 1.5
_MAX_STORE_WAIT_S, _POLL_S = 0.5, 0.001  # for the node to store the pages of `setup`: it may be busy
# How long a node waits for a loop's thread at the end: longer than a correct tick, short enough for a user at Ctrl-C.
JOIN_TIMEOUT_S = 0.5


class ThreadExecutor:
    """Executor that calls the loop from a thread, on deadlines: work in a tick does not delay the next one."""

    setup_timeout_s: float = 0.5

    def __init__(self, loop: Loop, life: NodeLife) -> None:
        self._loop = loop
        self._life = life
        self._clock = loop.parent.clock
        self._period_s = 1.0 / loop.max_tick_rate_hz if loop.max_tick_rate_hz else 0.0
        self._stopping = threading.Event()
        self._waking = threading.Event()  # set to end a wait: by `stop` or `wake`
        self._is_due = False  # a tick in addition to the rate has been requested
        self._pages = WakingPages(loop, self)
        self._halting = threading.Lock()
        self._is_halted = False
        self._has_setup_failed = False  # its setup failed while a caller waited: reported there, and the node continues
        self._give_up_s: float | None = None  # when another thread called `stop`, plus the timeout
        # A daemon thread: a loop that hangs must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name=loop.name, daemon=True)
        self.ticks: int = 0
        self.late_s: float = 0.0

    @property
    def is_stopped(self) -> bool:
        """Whether no more ticks will follow."""
        return self._stopping.is_set() or not self._thread.is_alive()

    def start(self) -> None:
        """Start the thread."""
        self._pages.begin()
        self._thread.start()

    def _run(self) -> None:
        life, loop = self._life, self._loop
        try:
            pages = self._set_up()
            if loop.setup_result is not None:
                loop.setup_result.set_result(None)  # first: the node may wait for it, and stores nothing meanwhile
            self._wait_until_stored(pages)
            self._tick_on_deadlines()
        except BaseException as error:
            failure = life.report.failure_of(loop, error, "loop")
            self._has_setup_failed = loop.setup_result is not None and loop.setup_result.set_result(failure)
            if not (self._has_setup_failed or life.handle_failure(loop, failure)):
                self._report(failure)
        finally:
            self._halt_once()

    def _set_up(self) -> dict[DataKey, Page]:
        """Call `setup`, and return the pages that it has stored."""
        loop, pages = self._loop, dict[DataKey, Page]()
        schedule = loop.schedule

        def keep(tasks: SomeTasks) -> None:
            schedule(tasks)
            scheduled = [tasks] if isinstance(tasks, Task) else tasks or ()
            pages.update((one.page.key, one.page) for one in scheduled if one is not None and one.page is not None)

        vars(loop)["schedule"] = keep
        try:
            self._life.call_loop(loop, "setup")
        finally:
            del vars(loop)["schedule"]
        return pages

    def _wait_until_stored(self, pages: dict[DataKey, Page]) -> None:
        """Wait until the node has stored pages of `setup`: `loop` may look them up, as in lock step."""
        stored, give_up_s = self._loop.parent.datastore.pages, time.monotonic() + _MAX_STORE_WAIT_S
        for key, page in pages.items():
            while (newest := stored.get(key)) is None or newest.created_at_s < page.created_at_s:
                if time.monotonic() > give_up_s or self._stopping.wait(_POLL_S):
                    return

    def _report(self, failure: ComponentFailedError) -> None:
        if self._has_setup_failed or self._loop.is_removed:  # then the node continues
            self._life.node.add_note(str(failure))
        else:
            self._life.node.inbox.fail(failure)

    def _tick_on_deadlines(self) -> None:
        loop, clock = self._loop, self._clock
        deadline_s = clock.now_s() + loop.first_tick_after_s
        self._stopping.wait(loop.first_tick_after_s)
        while True:
            self._waking.clear()  # before the checks below: a request from now on ends the wait
            self._is_due = False
            if self._stopping.is_set():
                return
            self.ticks += 1
            begun_s = clock.now_s()
            self._life.call_loop(loop, "loop")
            is_periodic = loop.next_tick_at_s is None
            deadline_s = deadline_s + self._period_s if loop.next_tick_at_s is None else loop.next_tick_at_s
            spare_s = deadline_s - clock.now_s()
            if spare_s > 0:
                is_woken = self._waking.wait(min(spare_s, threading.TIMEOUT_MAX))  # not sleep: stop() ends it at once
                is_due = self._is_due
                if is_woken and not is_due:
                    soonest_s = begun_s + _MIN_WAKE_PERIODS * self._period_s
                    self._stopping.wait(max(0.0, min(deadline_s, soonest_s) - clock.now_s()))
                if not is_periodic:
                    deadline_s = clock.now_s()  # the periods that it slept through are not missed
                elif is_woken and is_due:
                    deadline_s -= self._period_s  # as it was
                elif is_woken:
                    deadline_s = clock.now_s() + (_MAX_WAKE_WAIT_PERIODS - 1.0) * self._period_s
            elif self._period_s:
                self.late_s = max(self.late_s, -spare_s)
                missed = int(-spare_s / self._period_s)  # skip missed ticks instead of catching up
                deadline_s += missed * self._period_s

    def _halt_once(self) -> None:
        with self._halting:
            if self._is_halted:
                return
            self._is_halted = True
        try:
            self._loop.halt()
        except BaseException as error:
            self._report(self._life.report.failure_of(self._loop, error, "halt"))

    def wake(self) -> None:
        """Request the next tick now, or half a period after the last one."""
        self._waking.set()

    def tick_now(self) -> None:
        """Request a tick now; the next one is when it was due anyway."""
        self._is_due = True
        self._waking.set()

    def stop(self) -> None:
        """Request no more ticks, and end the wait for the next one."""
        if self._give_up_s is None and self._thread is not threading.current_thread():
            self._give_up_s = self._clock.now_s() + JOIN_TIMEOUT_S
        self._stopping.set()
        self._waking.set()

    def join(self) -> None:
        """Stop and wait for the thread; if it does not end in time, halt the loop from here and leave the thread."""
        self.stop()
        self._pages.end()
        if self._thread.ident is None or self._give_up_s is None:
            return
        with suppress(KeyboardInterrupt):  # a second Ctrl-C: halt now
            # Counted from `stop`, not from now: several loops that hang then cost one timeout together.
            self._thread.join(max(self._give_up_s - self._clock.now_s(), 0.0))
            if self._is_halted:  # by its thread: a halt that has begun, and may yet raise, has as long again
                self._thread.join(max(self._give_up_s + JOIN_TIMEOUT_S - self._clock.now_s(), 0.0))
        if self._thread.is_alive():
            step, limit_s = ("halt", 2.0 * JOIN_TIMEOUT_S) if self._is_halted else ("loop", JOIN_TIMEOUT_S)
            location = current_location(sys._current_frames().get(self._thread.ident))
            self._halt_once()
            self._loop.parent.add_note(
                f"Loop '{self._loop.name}' did not end within {limit_s:g} s: something in its {step}() blocks"
                f"{'' if location is None else f' ({location})'}.",
                is_recorded=not self._loop.parent.is_in_lock_step,  # there a thread has nothing to do with the run
            )
