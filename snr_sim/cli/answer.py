"""Where a command's answer goes: to stdout, with nothing between, whatever a student's code prints or closes."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any


@contextmanager
def guarded(is_json: bool) -> Iterator[None]:
    """Gives code of the student's a stdout of its own while it is entered.

    With --json it leads to stderr, so that stdout holds our one object and nothing else, also if a library written
    in C prints. Without, it leads to where ours leads, and closing it costs us nothing.
    """
    before = sys.stdout
    before.flush()
    target = sys.stderr if is_json else before
    kept = _duplicate(before)
    try:
        if is_json and kept is not None:
            os.dup2(sys.stderr.fileno(), before.fileno())
        sys.stdout = _Lent(target)
        yield
    finally:
        sys.stdout = before
        if kept is not None:
            os.dup2(kept, before.fileno())
            os.close(kept)


def _duplicate(stream: Any) -> int | None:
    """Returns a second descriptor of a real stdout, or None where a test has put something else in its place."""
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.fileno()
        return os.dup(stream.fileno())
    return None


class _Lent(io.TextIOBase):
    """Passes on what is written, and does not mind being closed."""

    def __init__(self, target: Any) -> None:
        self._target = target

    def write(self, text: str) -> int:
        """Passes it on."""
        return int(self._target.write(text))

    def flush(self) -> None:
        """Passes it on."""
        self._target.flush()

    def close(self) -> None:
        """Leaves everything open: the stream is only lent."""

    def fileno(self) -> int:
        """Returns the descriptor, as some libraries ask for it."""
        return int(self._target.fileno())
