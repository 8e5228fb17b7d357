"""Graceful shutdown at Ctrl-C and SIGTERM: a terminate task, components halted, actuators neutral, trace closed.

A signal handler here never raises into the machine. It puts a terminate task in the inbox, like any other input. If
student code is still running after `GRACE_PERIOD_S` (a `while True`, a `sleep(60)`), it is interrupted. A second signal
interrupts it at once. A `halt` that has just begun, and snr_sim's own steps at the end of a run, are not interrupted:
repeated Ctrl-C must not prevent the motors from being stopped. If the code swallows the interrupts too, the process
is ended by `LastResort`, from another thread, as the node's own is the stuck one; loops are halted first, so that
actuators are neutral. C code that holds the interpreter lock stops all threads, this one too: then only the runner of a
role in a process, or SIGKILL, ends the process. Boards disarm by themselves after 0.2 s without a command.

Python runs signal handlers between bytecodes only. A signal that arrives after that check but before the sleep system
call does not interrupt the call: `sleep(60)` would last its whole minute. So a thread reads every signal from
`signal.set_wakeup_fd`, and sends it again if its handler has not run. Sending a pending signal twice has no further
effect. After that the thread monitors the run.

A live edit's code that does not return is interrupted, too, by SIGVTALRM from the watchdog: see `interrupt_new_code`.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from snr_sim.core.loop import Loop
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.source_location import INTERRUPT_FIX, after_line, current_location, is_student_file
from snr_sim.prelude import tasks
from snr_sim.prelude.component import Component

GRACE_PERIOD_S = 0.3
FINAL_ESCALATION = 3  # timer rings after the signal without a running component: something other than a component hangs
# A run without any change for this time after a signal is stuck. Longer than each component's time at the end.
STUCK_S = 2.0
FILES_S = 10.0  # the same while no component runs: the recording may be waiting for a slow disk
HALT_S = 1.0  # for all halts together; a loop on a thread that hangs takes 0.5 s, one in a process 0.8 s
# To interrupt new code. Only the last attempt interrupts library code that it calls, since that may hold a lock; each
# has some signals, so that even a loop that prints is usually interrupted in its own line.
MAX_ATTEMPTS = 4
SIGNALS, SIGNAL_PERIOD_S = 20, 0.002
WAKE_S = 0.1  # a handler runs at once, except during a long call into C code
_NO_SIGNAL = b"\0"  # ends the thread: closing the pipe would not, while a forked child holds it
_watched: list[int] = []  # file descriptors; a forked child must not write its signals to ours

_entered: list[int] = []  # thread of each active `graceful_shutdown`: the main one only; they can be nested


class RunInterrupted(KeyboardInterrupt):
    """Interrupt raised inside code that does not return although the run is to end."""


class CallInterrupted(BaseException):
    """Interrupt raised inside a live edit's code that does not return; `except Exception` lets it pass."""


@contextmanager
def graceful_shutdown(nodes: Sequence[NodeParts]) -> Iterator[list[str]]:
    """Turn signals into terminate tasks while active; yield a list that collects the signals' names.

    Python runs signal handlers in the main thread only; in another thread this does nothing.
    """
    caught: list[str] = []
    escalations: list[int] = []
    running_before: dict[str, Component | None] = {}
    if threading.current_thread() is not threading.main_thread():
        yield caught
        return

    def on_signal(number: int, _frame: FrameType | None) -> None:
        caught.append(signal.Signals(number).name)
        if len(caught) > 1:
            for node in nodes:
                if not node.is_finished:
                    interrupt(node)
            return
        for node in nodes:
            node.enqueue_input(tasks.terminate(caught[0]), "signal")
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, GRACE_PERIOD_S, GRACE_PERIOD_S)

    def on_timer(number: int, _frame: FrameType | None) -> None:
        escalations.append(number)
        for node in nodes:
            before, running = running_before.get(node.name), node.machine.running
            running_before[node.name] = running
            # Before the shutdown, code that runs now has run since the signal. In it, each component has its own time.
            if not node.is_finished or running is before:
                interrupt(node)
        if len(escalations) == FINAL_ESCALATION and not any(node.is_finished for node in nodes):
            raise RunInterrupted("the run did not come to an end: the plant, or what else is stepped, did not return")

    def interrupt(node: NodeParts) -> None:
        if node.machine.running is not None:
            raise RunInterrupted(f"component '{node.machine.running.name}' did not return")

    def on_overdue(_: int, frame: FrameType | None) -> None:
        for node in nodes:
            call = node.machine.guarded_call  # None if it has returned meanwhile
            if call is None or call.attempts == 0:
                continue
            if call.attempts == MAX_ATTEMPTS or (frame is not None and is_student_file(frame.f_code.co_filename)):
                call.is_interrupted = True
                raise CallInterrupted

    last_resort = LastResort(nodes, threading.get_ident())

    def check(number: int) -> None:
        last_resort.check(signal.Signals(number).name, 128 + number)

    handlers: dict[int, Any] = {signal.SIGINT: on_signal, signal.SIGTERM: on_signal}
    if hasattr(signal, "SIGALRM"):
        handlers |= {signal.SIGALRM: on_timer, signal.SIGVTALRM: on_overdue}
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    _entered.append(threading.get_ident())
    try:
        with wake_on_signals((signal.SIGINT, signal.SIGTERM), caught, check):
            yield caught
    finally:
        _entered.pop()
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in before.items():
            signal.signal(number, handler)


def interrupt_main_thread() -> None:
    """Interrupt the main thread's code as after a signal, and again if it does not return; from any thread.

    Does nothing outside of `graceful_shutdown`, and on systems without interval timers.
    """
    if _entered and hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 1e-6, GRACE_PERIOD_S)


def interrupt_new_code(node: NodeParts, message: str) -> bool:
    """Try to interrupt the call of new code that a node is in, from any thread; return whether there is one to try.

    The signal's handler runs on the node's thread and raises only if that call has not returned yet, so nothing else
    is interrupted. Python runs such handlers on the main thread alone: a node on another thread is not interrupted, nor
    is any on Windows, nor C code that does not return to Python. Code that catches BaseException may continue.

    Args:
        node: the node.
        message: what is reported of the call, after the student's line.
    """
    call = node.machine.guarded_call
    if call is None or not call.is_interruptible or call.attempts == MAX_ATTEMPTS:
        return False
    if node.thread_id not in _entered or not hasattr(signal, "pthread_kill"):
        return False
    call.message = message
    call.attempts += 1
    for _ in range(SIGNALS):
        signal.pthread_kill(node.thread_id, signal.SIGVTALRM)
        if node.machine.guarded_call is not call:
            break
        time.sleep(SIGNAL_PERIOD_S)
    return True


@contextmanager
def wake_on_signals(numbers: Sequence[int], handled: Sequence[object], check: Callable[[int], None]) -> Iterator[None]:
    """Wake the main thread at the first of these signals, while active. Call it from the main thread only.

    A Python handler makes `handled` no longer empty. After a signal, a thread calls `check` with its number in a loop.
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


class LastResort:
    """Monitor of a run that is to end; `main` identifies the thread that runs its nodes."""

    def __init__(self, nodes: Sequence[NodeParts], main: int) -> None:
        self._nodes = nodes
        self._main = main
        self._state: list[Any] | None = None
        self._since_s = 0.0

    def check(self, reason: str, status: int) -> None:
        """End the process with this exit status if nothing has changed for too long since the run was to end."""
        running = [node.machine.running for node in self._nodes]
        state = [*map(id, running), *((node.is_finished, node.machine.executed) for node in self._nodes)]
        now_s = time.monotonic()
        if state != self._state:
            self._state, self._since_s = state, now_s
        is_writing_files = all(node.is_finished for node in self._nodes) and all(one is None for one in running)
        if now_s - self._since_s >= (FILES_S if is_writing_files else STUCK_S):
            self._end_process(reason, status)

    def _end_process(self, reason: str, status: int) -> None:
        stuck = next((node for node in self._nodes if node.machine.running is not None), None)
        name = "" if stuck is None or stuck.machine.running is None else stuck.machine.running.name
        what = f"component '{name}'" if name else "the run"
        location = current_location(sys._current_frames().get(self._main))
        because = f"{what} did not return, although it was interrupted"
        loops = [
            loop
            for node in self._nodes
            for loop in node.components.values()
            if isinstance(loop, Loop) and node.has_begun(loop)
        ]
        for loop in loops:
            loop.stop()
        run_in_parallel([*(loop.join for loop in loops), *([sys.stdout.flush] if sys.stdout else [])], HALT_S)
        run_in_parallel([loop.terminate for loop in loops], HALT_S)
        if stuck is not None:
            stuck.report.record_interrupt(name, after_line(location, because))
            time.sleep(2 * 0.05)  # two periods of the trace's flusher
        halted = f" Halted: {', '.join(loop.name for loop in loops)}." if loops else ""
        what = f"{reason}: {because}. After {STUCK_S:g} s the process was ended.{halted}\n  Try: {INTERRUPT_FIX}"
        write_stderr(after_line(location, what))
        os._exit(status)


def run_in_parallel(steps: Sequence[Callable[[], object]], timeout_s: float) -> None:
    """Run each step on its own thread; wait at most the timeout for all of them together."""

    def run(step: Callable[[], object]) -> None:
        with suppress(BaseException):  # the other steps must still run, and there is no run left that could fail
            step()

    threads = [threading.Thread(target=run, args=(step,), daemon=True) for step in steps]
    for thread in threads:
        thread.start()
    give_up_s = time.monotonic() + timeout_s
    for thread in threads:
        thread.join(max(give_up_s - time.monotonic(), 0.0))


def write_stderr(text: str) -> None:
    """Write to stderr without its lock, which the stuck thread may hold."""
    with suppress(OSError):
        os.write(2, f"{text}\n".encode(errors="backslashreplace"))
