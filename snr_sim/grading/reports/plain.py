"""Untrusted text escaped for where it is shown: a student's program may print anything.

Invisible characters, and those that a terminal, a browser or a spreadsheet would interpret, are shown as escapes.
"""

from __future__ import annotations

import re
import unicodedata

_KEPT = "\n\t\u200c\u200d"  # the last two join letters in Persian and Indian scripts, and emoji
_HIDDEN = {"Cc", "Cf", "Cs", "Cn", "Co", "Zl", "Zp"}
_MARKDOWN = re.compile(r"([\\`*_\[\]<>|#~&!@])")
_FORMULA = ("=", "+", "-", "@", "\t", "|", "%")


def plain(text: str, limit: int = 4000) -> str:
    """Return a text in which all that is there can be seen, cut to a length.

    >>> print(plain("red \\x1b[31m, back \\u202e, bell \\a, half \\ud800"))
    red \\x1b[31m, back \\u202e, bell \\x07, half \\ud800
    """
    shown = "".join(map(_visible, text[:limit]))
    return shown if len(text) <= limit else f"{shown} ... ({len(text) - limit} characters more)"


def _visible(char: str) -> str:
    is_seen = char in _KEPT or unicodedata.category(char) not in _HIDDEN
    return char if is_seen else char.encode("unicode_escape").decode()


def one_line(text: str, limit: int = 300) -> str:
    """Return a text on one line.

    >>> one_line("a\\n  b\\r\\n\\tc")
    'a b c'
    """
    return plain(" ".join(text.split()), limit)


def markdown(text: str) -> str:
    """Return a line that Markdown shows unchanged: no links, no pictures, no HTML.

    >>> print(markdown("![x](http://a) <b>|`"))
    \\!\\[x\\](http:&#47;/a) \\<b\\>\\|\\`
    """
    # Some renderers make links of bare addresses.
    return _MARKDOWN.sub(r"\\\1", one_line(text, 2000)).replace("://", ":&#47;/").replace("www.", "www&#46;")


def fenced(text: str, indent: str = "") -> str:
    """Return a block of Markdown that shows a text unchanged, whatever it contains."""
    shown = plain(text)
    longest = max((len(run) for run in re.findall("`+", shown)), default=0)
    fence = "`" * max(3, longest + 1)
    return "\n".join(indent + line for line in [f"{fence}text", *shown.split("\n"), fence])


def cell(text: str) -> str:
    """Return a text for a table's cell, which no spreadsheet reads as a formula.

    >>> cell("=1+1"), cell("ada"), cell(" \\t@x")
    ("'=1+1", 'ada', "'@x")
    """
    shown = one_line(text)
    return f"'{shown}" if shown.startswith(_FORMULA) else shown
