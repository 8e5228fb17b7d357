"""Inside a process that `core/process/spawn.py` has started: its first steps, its orders and its end."""

from __future__ import annotations

import faulthandler
import importlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

HELD_BACK = (signal.SIGINT, signal.SIGTERM)

# Whether this process is reading the files of the program it was started from: they must not start it again.
is_reading_program = False


def command(target: str, line: int) -> str:
    """Return the Python text that a process begins with; `target` is "module:function", `line` its end of the line."""
    begin = f"import sys; sys.path[:] = {sys.path!r}; from snr_sim.core.process.spawned import main"
    return f"{begin}; main({target!r}, {line})"


def main(target: str, line: int) -> None:
    """Run the target; do not return."""
    status = 1
    try:
        os.set_inheritable(line, False)
        faulthandler.enable(all_threads=False)  # a crash in a library's C code then names the line that called it
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # until somebody here wants it
        for stream in (sys.stdout, sys.stderr):
            stream.reconfigure(line_buffering=True, errors="backslashreplace")  # type: ignore[union-attr]
        module, _, function = target.partition(":")
        status = getattr(importlib.import_module(module), function)(Connection(line)) or 0
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):  # nobody reads it any more
                stream.flush()
        os._exit(status)  # not by sys.exit: a thread that hangs must not keep the process


def obey(
    receive: Callable[[], list[Any]], end: Callable[[str], None], handle: Callable[..., None], orphan_s: float
) -> None:
    """Handle the messages of the process that started this one; in a thread of its own, it does not return.

    Args:
        receive: returns the next message.
        end: ends in order, for a reason; also when the other process has gone.
        handle: gets all other messages: kind, then values.
        orphan_s: how long after the other process has gone this one goes, whatever it does.
    """
    while True:
        try:
            kind, *values = receive()
        except (EOFError, OSError):
            go_quiet()
            end("orphaned")
            time.sleep(orphan_s)
            os._exit(1)
        if kind == "end":
            threading.Thread(target=end, args=values, daemon=True).start()
        else:
            handle(kind, *values)


def go_quiet() -> None:
    """Print to nobody from now on: with the reader gone a `print` in a student's `halt` would raise."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for output in (1, 2):
        os.dup2(nowhere, output)
    os.close(nowhere)


def hear_signals() -> None:
    """Let in the signals that were held back since before this process began."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, HELD_BACK)
