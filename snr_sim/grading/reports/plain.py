"""Untrusted text escaped for Markdown and for tables: a student's program may print anything.

Characters that a browser or a spreadsheet would interpret are escaped, after those of `prelude/text.py`.
"""

from __future__ import annotations

import re

from snr_sim.prelude.text import one_line, plain

_MARKDOWN = re.compile(r"([\\`*_\[\]<>|#~&!@])")
_FORMULA = ("=", "+", "-", "@", "\t", "|", "%")


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
