"""Where the program `snr` begins: before anything slow is imported, so that a signal finds somebody to answer it."""

from __future__ import annotations

import signal
import sys


def main() -> None:
    """Runs the command line. A signal while it is still being imported ends it as one does later: in a word."""
    stopped_by: list[int] = []

    def stop(number: int, frame: object) -> None:
        stopped_by.append(number)
        raise KeyboardInterrupt(number)

    signal.signal(signal.SIGTERM, stop)
    try:
        from snr_sim.cli.main import main as run

        run()
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        sys.exit(128 + (stopped_by[0] if stopped_by else signal.SIGINT))
