"""Standard streams of a program that was started without some of them, as by `>&-` in a shell."""

from __future__ import annotations

import os
import sys


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
