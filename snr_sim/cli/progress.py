"""A progress line for runs that take time: on a terminal only, and on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_PERIOD_S = 0.1


@contextmanager
def progress(name: str, is_shown: bool) -> Iterator[Callable[[float], None] | None]:
    """Yields what is to be called with the virtual time at each new moment, or None if nothing is shown."""
    if not (is_shown and sys.stderr.isatty()):
        yield None
        return
    from snr_sim.cli.plain_console import as_it_is, plain_console

    shown_at_s = 0.0
    with plain_console(stderr=True).status("starting") as status:

        def tick(time_s: float) -> None:
            nonlocal shown_at_s
            now_s = time.monotonic()
            if now_s - shown_at_s > _PERIOD_S:
                shown_at_s = now_s
                status.update(as_it_is(f"{name}: t = {time_s:.1f} s (Ctrl-C ends the run in order)"))

        yield tick
