"""Text from elsewhere, made fit for a terminal."""

from __future__ import annotations


def escaped(text: str) -> str:
    """Return a line with what a terminal would act on (colours, a cleared screen) shown as its escape."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def printable(text: str) -> str:
    """Return lines of text with what a terminal would act on shown as its escape."""
    return "\n".join(map(escaped, text.splitlines()))
