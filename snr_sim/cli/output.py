"""Output of commands: only the result on stdout, and notes on stderr."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.text import visible, visible_json

if TYPE_CHECKING:
    from snr_sim.recording.reader import Trace

_STDOUT, _STDERR = 1, 2  # the descriptors that C libraries and child processes print to


def print_json(fields: dict[str, Any]) -> None:
    """Print the single object of --json."""
    from snr_sim.recording.folder import as_json

    print_encoded(as_json(fields))


def print_text(text: object = "", end: str = "\n", flush: bool = False) -> None:
    """Print a part of the result. What a terminal would interpret is shown as escapes: runs may come from others."""
    print(visible(str(text)), end=end, flush=flush)  # noqa: T201 the one for texts


def print_encoded(text: str, end: str = "\n") -> None:
    """Print JSON; what a terminal would interpret is escaped, which leaves its values the same."""
    print(visible_json(text), end=end)  # noqa: T201 the one for JSON


def print_note(text: str) -> None:
    """Print a note to the user in addition to the result."""
    print_line(sys.stderr, f"note: {text}")


def print_warnings(trace: Trace, before: str = "") -> None:
    """Print remarks about a trace: that it was changed or truncated."""
    from snr_sim.recording.folder import trace_warnings

    for remark in trace_warnings(trace):
        print_note(before + remark)


@contextmanager
def capture_output(is_json: bool) -> Iterator[None]:
    """Redirect stdout for a student's code within the block.

    With --json it is redirected to stderr, so that stdout has the single object only, even if a C library prints.
    Without --json it has the same target as before, and the student's code can close it without an effect.
    """
    before = sys.stdout
    before.flush()
    target = sys.stderr if is_json else before
    kept = None
    with suppress(OSError):
        kept = os.dup(_STDOUT)
    try:
        if is_json:
            with suppress(OSError):  # stdout or stderr does not exist
                os.dup2(_STDERR, _STDOUT)
        sys.stdout = _NonClosingStream(target)
        yield
    finally:
        sys.stdout = before
        if kept is not None:
            os.dup2(kept, _STDOUT)
            os.close(kept)


class _NonClosingStream(io.TextIOBase):
    """Stream that passes on what is written and ignores `close`."""

    def __init__(self, target: Any) -> None:
        self._target = target

    def write(self, text: str) -> int:
        """Pass it on."""
        return int(self._target.write(text))

    def flush(self) -> None:
        """Pass it on."""
        self._target.flush()

    def close(self) -> None:
        """Leave the stream open: its owner closes it."""

    def fileno(self) -> int:
        """Return the descriptor, as some libraries ask for it."""
        return int(self._target.fileno())
