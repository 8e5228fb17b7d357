"""What rich shows on a terminal, to the letter.

By itself it would take the [us] and [hardware] of a text for colours, :x: for a picture, and a check whose title begins
with [/] for a mistake in its own language, which ends the program.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text


def plain_console(stderr: bool = False, width_in_a_pipe: int | None = None) -> Console:
    """Return a console that shows texts as they are.

    Args:
        stderr: whether it writes there, and not to stdout.
        width_in_a_pipe: of a line, where no terminal tells; 80 if not given.
    """
    from rich.console import Console

    console = Console(stderr=stderr, highlight=False, markup=False, emoji=False)
    if not console.is_terminal and width_in_a_pipe is not None:
        console.width = width_in_a_pipe
    return console


def as_it_is(words: str) -> Text:
    """Return what says these words where rich would read a text its own way, as in `Console.status`."""
    from rich.text import Text

    return Text(words)
