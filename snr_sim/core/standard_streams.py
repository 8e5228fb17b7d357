"""Standard streams: of a program that was started without some of them, as by `>&-` in a shell, and lines on them."""

from __future__ import annotations

import os
import sys
import threading
from contextlib import suppress
from typing import TextIO

from snr_sim.prelude.text import visible

_printing = threading.Lock()


def open_closed_streams() -> None:
    """Open the null device for each of stdin, stdout and stderr that is closed. Safe to call twice.

    Otherwise the next file that is opened, such as a trace, gets the descriptor of stdout, so that output of C code
    is written into it; and `sys.stdout` is None.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # it gets the lowest free number, so this one
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115 for the rest of the program


def print_line(stream: TextIO, line: str) -> None:
    """Print a text and the end of its line, from any thread; do nothing if the stream does not take it.

    A robot must not stop because its log is on a full disk, or because the reader of a pipe has gone. Characters that a
    terminal would interpret are shown as escapes, because the text may contain what a peer has sent.
    """
    forward_line(stream, visible(line))


def forward_line(stream: TextIO, line: str) -> None:
    """Print a line unchanged, colours too, like `print_line`: for the output of the user's own programs."""
    # One at a time: Python's text streams have lost a line when a second thread wrote while the first one flushed.
    with _printing, suppress(ValueError, OSError):
        stream.write(line + "\n")
        stream.flush()
