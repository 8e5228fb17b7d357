"""Untrusted text for a terminal: from a peer, from another user's recording, or printed by a student's program.

Invisible characters, and those that a terminal would interpret, are shown as escapes.
"""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Callable

_KEPT = "\n\t\u200c\u200d"  # the last two join letters in Persian and Indian scripts, and emoji
_HIDDEN = {"Cc", "Cf", "Cs", "Cn", "Co", "Zl", "Zp"}


def visible(text: str) -> str:
    """Return a text in which all that is there can be seen.

    >>> print(visible("red \\x1b[31m, back \\u202e, bell \\a, half \\ud800"))
    red \\x1b[31m, back \\u202e, bell \\x07, half \\ud800
    """
    return _with_escapes(text, lambda char: char.encode("unicode_escape").decode())


def visible_json(text: str) -> str:
    """Return JSON of the same value in which all that is there can be seen.

    >>> print(visible_json('"\\x9b2J"'))
    "\\u009b2J"
    """
    return _with_escapes(text, lambda char: json.dumps(char)[1:-1])


def _with_escapes(text: str, escape: Callable[[str], str]) -> str:
    if text.isprintable():  # in C, and so it is for almost every line
        return text
    return "".join(
        char if char in _KEPT or unicodedata.category(char) not in _HIDDEN else escape(char) for char in text
    )


def plain(text: str, limit: int = 4000) -> str:
    """Return a visible text, cut to a length.

    >>> plain("depth\\r", 5)
    'depth ... (1 characters more)'
    """
    shown = visible(text[:limit])
    return shown if len(text) <= limit else f"{shown} ... ({len(text) - limit} characters more)"


def one_line(text: str, limit: int = 300) -> str:
    """Return a visible text on one line.

    >>> one_line("a\\n  b\\r\\n\\tc")
    'a b c'
    """
    return plain(" ".join(text.split()), limit)


def escaped(text: str) -> str:
    """Return a name, or other text that has one line, with all escaped that cannot be printed: line ends, too."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
