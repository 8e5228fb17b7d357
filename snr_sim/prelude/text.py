"""Text from outside, made safe for a terminal."""

from __future__ import annotations


def escaped(text: str) -> str:
    """Return a line with terminal control characters (colours, a cleared screen) replaced by escapes."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def printable(text: str) -> str:
    """Return lines of text with terminal control characters replaced by escapes."""
    return "\n".join(map(escaped, text.splitlines()))
