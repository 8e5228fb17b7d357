"""Literal output with rich.

By default rich interprets [us] and [hardware] in a text as styles and :x: as an emoji, and raises an error for a title
that begins with [/], which ends the program.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text


def plain_console(stderr: bool = False, width_in_a_pipe: int | None = None) -> Console:
    """Return a console that prints texts without interpreting markup.

    Args:
        stderr: whether it writes to stderr instead of stdout.
        width_in_a_pipe: of a line when the output is not a terminal; 80 by default.
    """
    from rich.console import Console

    console = Console(stderr=stderr, highlight=False, markup=False, emoji=False)
    if not console.is_terminal and width_in_a_pipe is not None:
        console.width = width_in_a_pipe
    return console


def escape_markup(words: str) -> Text:
    """Return an object that prints this text literally where rich would interpret markup, as in `Console.status`."""
    from rich.text import Text

    return Text(words)
