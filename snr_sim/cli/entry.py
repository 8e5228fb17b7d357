"""Entry point of the program `snr`: handles signals before any slow import."""

from __future__ import annotations

import atexit
import os
import sys
import threading
import time
from contextlib import suppress

from snr_sim.cli import stopping
from snr_sim.core.standard_streams import open_closed_streams, print_line

_THREADS_S = 0.5  # time for threads to end before they are reported


def main() -> None:
    """Run the command line. A signal during its import ends it as a later one does: with one word of output."""
    open_closed_streams()
    stopping.interrupt_at_signals()
    ending = Ending()
    atexit.register(ending.leave)  # the first, so it is called last
    try:
        from snr_sim.cli.main import main as run

        run()
    except KeyboardInterrupt:
        print_line(sys.stderr, "Stopped.")
        ending.status = stopping.status()
        sys.exit(ending.status)
    except SystemExit as end:
        ending.status = end.code if isinstance(end.code, int) else int(end.code is not None)
        raise
    finally:
        stopping.end_by_default()
        _name_threads()


class Ending:
    """Immediate end of the process after all exit functions.

    Python would destroy modules and objects first: 0.1 to 0.3 s for a run that ends in 0.004 s, and three times that
    on a busy computer.
    """

    def __init__(self) -> None:
        self.status: int = 1  # of an exception, which Python prints

    def leave(self) -> None:
        """Flush the standard streams and end the process."""
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):  # the reader has closed the pipe, or a student's code the stream
                stream.flush()
        os._exit(self.status)


def _name_threads() -> None:
    give_up_s = time.monotonic() + _THREADS_S
    for thread in threading.enumerate():
        if not thread.daemon and thread is not threading.main_thread():
            thread.join(max(give_up_s - time.monotonic(), 0.0))
    if threading.active_count() > 1:
        from snr_sim.core.standstill import notes_on_threads

        for note in notes_on_threads():
            print_line(sys.stderr, f"note: {note}")
