"""Progress line for long runs: on a terminal only, and on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from snr_sim.cli.plain_console import escape_markup, plain_console

if TYPE_CHECKING:
    from rich.status import Status

_PERIOD_S = 0.1


@contextmanager
def progress(name: str, after_s: float) -> Iterator[Callable[[float], None] | None]:
    """Yield a function to call with the virtual time at each step, or None if there is no progress line.

    Args:
        name: of the run.
        after_s: wall time before it is first shown, so that short runs do not show it.
    """
    if not sys.stderr.isatty():
        yield None
        return
    with ExitStack() as stack:
        status: Status | None = None
        next_s = time.monotonic() + after_s

        def tick(time_s: float) -> None:
            nonlocal status, next_s
            now_s = time.monotonic()
            if now_s < next_s:
                return
            next_s = now_s + _PERIOD_S
            if status is None:
                status = stack.enter_context(plain_console(stderr=True).status(""))
            status.update(escape_markup(f"{name}: t = {time_s:.1f} s (Ctrl-C ends the run in order)"))

        yield tick
