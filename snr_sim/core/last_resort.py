"""End the process of a run that does not shut down because its code swallows every interrupt.

Called from the thread of `core/interrupts.py` or of `core/watchdog.py`, since the node's own thread is the stuck one.
Loops are halted first, so that actuators are neutral.

C code that holds the interpreter lock stops all threads, this one too: then only the runner of a role in a process, or
SIGKILL, ends the process. Boards disarm by themselves after 0.2 s without a command.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from snr_sim.core.loop import Loop
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.source_location import INTERRUPT_FIX, after_line, current_location

# A run without any change for this time after a signal is stuck. Longer than each component's time at the end.
STUCK_S = 2.0
FILES_S = 10.0  # the same while no component runs: the recording may be waiting for a slow disk
HALT_S = 1.0  # for all halts together; a loop on a thread that hangs takes 0.5 s, one in a process 0.8 s


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
