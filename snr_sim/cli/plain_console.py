"""Output with rich: literal texts, and the progress line of a run.

By default rich interprets [us] and [hardware] in a text as styles and :x: as an emoji, and raises an error for a title
that begins with [/], which ends the program.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from snr_sim.prelude.text import visible

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status
    from rich.text import Text

_PERIOD_S = 0.1  # of a progress line


def plain_console(stderr: bool = False, width_in_a_pipe: int | None = None) -> Console:
    """Return a console that prints texts without interpreting markup.

    In a pipe a line is 80 characters wide, or `width_in_a_pipe`.
    """
    from rich.console import Console

    class VisibleConsole(Console):
        """Shows what a terminal would interpret as escapes, in every text that is printed or put in a table."""

        def render_str(self, text: str, **options: Any) -> Text:
            return super().render_str(visible(text), **options)

    console = VisibleConsole(stderr=stderr, highlight=False, markup=False, emoji=False)
    if not console.is_terminal and width_in_a_pipe is not None:
        console.width = width_in_a_pipe
    return console


def escape_markup(words: str) -> Text:
    """Return an object that prints this text literally where rich would interpret markup, as in `Console.status`."""
    from rich.text import Text

    return Text(visible(words))


@contextmanager
def progress(name: str, after_s: float) -> Iterator[Callable[[float], None] | None]:
    """Yield a function that shows the virtual time of a run on a terminal, on stderr; None if there is no terminal.

    It is first shown after so much wall time, so that short runs do not show it.
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
