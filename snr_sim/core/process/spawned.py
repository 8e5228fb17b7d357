"""Code inside a process that `core/process/spawn.py` has started: its start, its messages and its end."""

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

BLOCKED_SIGNALS: tuple[signal.Signals, ...] = (signal.SIGINT, signal.SIGTERM)

# Whether this process is importing the files of the program that started it: they must not start it again.
is_reading_program = False


def command(target: str, line: int) -> str:
    """Return the Python code that a process starts with; `target` is "module:function", `line` its descriptor."""
    begin = f"import sys; sys.path[:] = {sys.path!r}; from snr_sim.core.process.spawned import main"
    return f"{begin}; main({target!r}, {line})"


def main(target: str, line: int) -> None:
    """Run the target; do not return."""
    status = 1
    try:
        os.set_inheritable(line, False)
        faulthandler.enable(all_threads=False)  # a crash in C code then names the line that called it
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # until a function here installs a handler
        for stream in (sys.stdout, sys.stderr):
            stream.reconfigure(line_buffering=True, errors="backslashreplace")  # type: ignore[union-attr]
        module, _, function = target.partition(":")
        status = getattr(importlib.import_module(module), function)(Connection(line)) or 0
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):  # its reader has gone
                stream.flush()
        os._exit(status)  # not sys.exit: a thread that hangs must not keep the process alive


def execute_messages(
    receive: Callable[[], list[Any]], end: Callable[[str], None], handle: Callable[..., None], orphan_s: float
) -> None:
    """Execute the parent's messages. Run it in a thread of its own, since it does not return.

    Args:
        receive: returns the next message.
        end: shuts down gracefully, for a reason; also called when the parent has ended.
        handle: gets all other messages: kind, then values.
        orphan_s: time from the parent's end until this process exits in any case.
    """
    while True:
        try:
            kind, *values = receive()
        except (EOFError, OSError):
            silence_output()
            end("orphaned")
            time.sleep(orphan_s)
            os._exit(1)
        if kind == "end":
            threading.Thread(target=end, args=values, daemon=True).start()
        else:
            handle(kind, *values)


def silence_output() -> None:
    """Discard output from now on: the reader has gone, so a `print` in a student's `halt` would raise."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for output in (1, 2):
        os.dup2(nowhere, output)
    os.close(nowhere)


def unblock_signals() -> None:
    """Unblock the signals that have been blocked since before this process began."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, BLOCKED_SIGNALS)
