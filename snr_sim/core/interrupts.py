"""Ctrl-C and SIGTERM end a run in order: a terminate task, components halted, actuators neutral, trace closed.

A signal handler here never raises into the machine. It puts a terminate task at the door, as any other input. Only
if a student's own code is still running a moment later (a `while True`, a `sleep(60)`), it is interrupted where it
is. A second signal interrupts it at once. But nothing interrupts a `halt` that has only just begun, nor the kit's own
steps at the end of a run: a person pressing Ctrl-C again and again must not keep the motors from being stopped. What
swallows the interrupts, too, is ended with the process: see `core/last_resort.py`.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

from snr_sim.core.last_resort import LastResort
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.wake_up import woken_by
from snr_sim.prelude import tasks
from snr_sim.prelude.component import Component

PATIENCE_S = 0.3
LAST_RING = 3  # so long after the signal no component runs, yet nobody looks at the door: something else hangs


_entered: list[int] = []  # the thread of each `orderly` that is entered: only the main one, one within the other


class Interrupted(KeyboardInterrupt):
    """Raised inside what does not return although the run is to end."""


@contextmanager
def orderly(nodes: Sequence[NodeParts]) -> Iterator[list[str]]:
    """Turn signals into terminate tasks while it is entered; yield a list that gets the signals' names.

    Signals reach only the main thread of a program; elsewhere this does nothing.
    """
    caught: list[str] = []
    rings: list[int] = []
    at_last_ring: dict[str, Component | None] = {}
    if threading.current_thread() is not threading.main_thread():
        yield caught
        return

    def on_signal(number: int, frame: FrameType | None) -> None:
        caught.append(signal.Signals(number).name)
        if len(caught) > 1:
            for node in nodes:
                if not node.is_over:
                    interrupt(node)
            return
        for node in nodes:
            node.enter(tasks.terminate(caught[0]), "signal")
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, PATIENCE_S, PATIENCE_S)

    def on_impatience(number: int, frame: FrameType | None) -> None:
        rings.append(number)
        for node in nodes:
            before, running = at_last_ring.get(node.name), node.machine.running
            at_last_ring[node.name] = running
            # Until the end has begun, what runs now has run since the signal. At the end, each has its own time.
            if not node.is_over or running is before:
                interrupt(node)
        if len(rings) == LAST_RING and not any(node.is_over for node in nodes):
            raise Interrupted("the run did not come to an end: the plant, or what else is stepped, did not return")

    def interrupt(node: NodeParts) -> None:
        if node.machine.running is not None:
            raise Interrupted(f"component '{node.machine.running.name}' did not return")

    last_resort = LastResort(nodes, threading.get_ident())

    def look(number: int) -> None:
        last_resort.look(signal.Signals(number).name, 128 + number)

    handlers: dict[int, Any] = {signal.SIGINT: on_signal, signal.SIGTERM: on_signal}
    if hasattr(signal, "SIGALRM"):
        handlers[signal.SIGALRM] = on_impatience
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    _entered.append(threading.get_ident())
    try:
        with woken_by((signal.SIGINT, signal.SIGTERM), caught, look):
            yield caught
    finally:
        _entered.pop()
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in before.items():
            signal.signal(number, handler)


def interrupt_what_runs() -> None:
    """Interrupt what the main thread runs, and again if that does not return, as after a signal; from any thread.

    Does nothing outside of `orderly`, and where a system has no such timer.
    """
    if _entered and hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 1e-6, PATIENCE_S)
