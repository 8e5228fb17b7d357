"""Graceful shutdown at Ctrl-C and SIGTERM: a terminate task, components halted, actuators neutral, trace closed.

A signal handler here never raises into the machine. It puts a terminate task in the inbox, like any other input. If
student code is still running after `GRACE_PERIOD_S` (a `while True`, a `sleep(60)`), it is interrupted. A second signal
interrupts it at once. A `halt` that has just begun, and snr_sim's own steps at the end of a run, are not interrupted:
repeated Ctrl-C must not prevent the motors from being stopped. If the code swallows the interrupts too, the process
is ended: see `core/last_resort.py`.

Python runs signal handlers between bytecodes only. A signal that arrives after that check but before the sleep system
call does not interrupt the call: `sleep(60)` would last its whole minute. So a thread reads every signal from
`signal.set_wakeup_fd`, and sends it again if its handler has not run. Sending a pending signal twice has no further
effect. After that the thread monitors the run.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from snr_sim.core.last_resort import LastResort
from snr_sim.core.node_parts import NodeParts
from snr_sim.prelude import tasks
from snr_sim.prelude.component import Component

GRACE_PERIOD_S = 0.3
FINAL_ESCALATION = 3  # timer rings after the signal without a running component: something other than a component hangs
WAKE_S = 0.1  # a handler runs at once, except during a long call into C code
_NO_SIGNAL = b"\0"  # ends the thread: closing the pipe would not, while a forked child holds it
_watched: list[int] = []  # file descriptors; a forked child must not write its signals to ours

_entered: list[int] = []  # thread of each active `graceful_shutdown`: the main one only; they can be nested


class RunInterrupted(KeyboardInterrupt):
    """Interrupt raised inside code that does not return although the run is to end."""


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

    def on_signal(number: int, frame: FrameType | None) -> None:
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

    def on_timer(number: int, frame: FrameType | None) -> None:
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

    last_resort = LastResort(nodes, threading.get_ident())

    def check(number: int) -> None:
        last_resort.check(signal.Signals(number).name, 128 + number)

    handlers: dict[int, Any] = {signal.SIGINT: on_signal, signal.SIGTERM: on_signal}
    if hasattr(signal, "SIGALRM"):
        handlers[signal.SIGALRM] = on_timer
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
