"""Passes records to a viewer during the run, on a separate thread that blocks neither the disk nor the robot."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from queue import SimpleQueue
from threading import Thread
from typing import Protocol

from snr_sim.core.standard_streams import print_line
from snr_sim.recording.records import Record, decode_line
from snr_sim.recording.references import References

MAX_UNSHOWN_BYTES = 64_000_000  # maximum backlog of a listener: minutes of a dive
CLOSE_TIMEOUT_S = 5.0  # for a listener that hangs, when the run ends


class TraceListener(Protocol):
    """Receiver of a run's records during the run, such as a live view; called on one thread of its own."""

    def add(self, record: Record) -> None:
        """Add a record."""

    def flush(self) -> None:
        """Show what was received so far: no further records are available at the moment."""


class ListenerThread:
    """Thread that passes whole records, made of the trace's lines, to a listener, from the first record on.

    A listener that fails or hangs receives no more records, and a warning is logged.
    """

    def __init__(self, listener: TraceListener) -> None:
        self._listener = listener
        self._references = References()
        self._batches: SimpleQueue[Sequence[bytes]] = SimpleQueue()
        self._given_bytes = 0  # written only by the caller of `give`
        self._shown_bytes = 0  # written only by the thread; the difference is queued
        self._is_stopped = False
        self._thread = Thread(target=self._show_until_closed, name="trace-listener", daemon=True)
        self._thread.start()

    def give(self, lines: Sequence[bytes]) -> None:
        """Queue lines of the trace for the listener; return at once."""
        if self._is_stopped or not lines:
            return
        self._given_bytes += sum(map(len, lines))
        if self._given_bytes - self._shown_bytes > MAX_UNSHOWN_BYTES:
            self._stop("it does not keep up")
            return
        self._batches.put(lines)

    def close(self) -> None:
        """Wait up to CLOSE_TIMEOUT_S until all is shown, and end the thread; safe to call twice."""
        self._batches.put(())  # the end
        self._thread.join(CLOSE_TIMEOUT_S)
        if self._thread.is_alive():
            self._stop("it does not answer")

    def _show_until_closed(self) -> None:
        try:
            while (lines := self._batches.get()) and not self._is_stopped:
                for line in lines:
                    self._listener.add(self._references.resolve(decode_line(line)))
                self._listener.flush()
                self._shown_bytes += sum(map(len, lines))
        except Exception as error:  # a failing view should not stop the recording
            self._stop(str(error))

    def _stop(self, reason: str) -> None:
        if not self._is_stopped:
            self._is_stopped = True
            print_line(sys.stderr, f"The live view has stopped: {reason}. The run continues and is recorded.")
