"""LocalConsole: commands typed in the terminal in which the node runs."""

from __future__ import annotations

import os
import select
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from queue import Empty
from typing import TextIO

from snr_sim.console.commands import TABLE
from snr_sim.console.parsing import MAX_LINE_CHARS, CommandResult
from snr_sim.console.session import ConsoleSession
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.node import Node
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.text import visible
from snr_sim.prelude.waiting import TimedQueue

POLL_PERIOD_S = 0.05  # maximum time that a closing node waits for this loop
SOON_S = 0.005
_READ_BYTES = 4096


class LocalConsoleFactory(LoopFactory):
    """Reads commands from the node's own terminal and prints their answers there; `help` lists them.

    Args:
        reads: input of command lines; standard input if not given. It needs a descriptor.
        prints: output of answers; standard output if not given.
        name: of the loop, and source of its tasks.
    """

    def __init__(self, reads: TextIO | None = None, prints: TextIO | None = None, name: str = "local_console") -> None:
        super().__init__()
        self.reads = reads
        self.prints = prints
        self.name = name

    def __reduce__(self) -> str:
        """Raise ConfigError: a terminal cannot be sent to another process."""
        raise ConfigError(
            "LocalConsoleFactory reads from the terminal, which only the program that starts the processes has.",
            fix="CommandReceiverFactory(54321) in this role, and `snr console 54321` in another terminal.",
        )

    def get(self, parent: NodeApi) -> LocalConsole:
        """Return the loop."""
        return LocalConsole(self, parent, self.name)


class LocalConsole(Loop):
    """Loop on a thread of its own, in lock step too: a user does not type in virtual time."""

    factory: LocalConsoleFactory
    is_reloaded_with_all = False

    def __init__(self, factory: LocalConsoleFactory, parent: NodeApi, name: str = "local_console") -> None:
        if not isinstance(parent, Node):
            raise ConfigError(
                "A LocalConsole is a loop of the node, in the node's own terminal.",
                fix="RemoteConsole(('127.0.0.1', port), commands).run(), or `snr console PORT`.",
            )
        super().__init__(factory, parent, name, max_tick_rate_hz=0)
        self._session = ConsoleSession(parent, TABLE, name)
        self._rest = b""
        self._lines: deque[str] = deque()
        self._is_at_end = False
        self._read: Callable[[], bytes | None]

    def begin(self) -> None:
        """Start the thread."""
        self.parent.start_loop(self, on_thread=True)

    def setup(self) -> None:
        """Determine how to read without blocking indefinitely."""
        stream = self.factory.reads or sys.stdin
        try:
            number, is_windows = stream.fileno(), sys.platform == "win32"
            self._read = _ThreadReader(number) if is_windows else partial(_select_and_read, number)
        except (AttributeError, OSError, ValueError):
            self.log.warning("there is no terminal to read commands from")
            self.stop()

    def loop(self) -> None:
        """Answer the lines typed, and show watched pages that have changed."""
        if self._lines or self._is_at_end:
            time.sleep(SOON_S)  # earlier input is not executed yet
        else:
            self._take(self._read())
        now_s = time.monotonic()
        if (outcome := self._session.outcome(now_s)) is not None:
            self._show(outcome)
        while self._lines and not self._session.is_waiting:
            answer = self._session.execute(self._lines.popleft())
            if not self._session.is_waiting:
                self._show(answer)
        if self._is_at_end and not (self._lines or self._session.is_waiting):
            self.stop()  # the terminal is closed, or the file is at its end; the node continues
        for answer in self._session.changes(now_s):
            self._show(answer)

    def _take(self, data: bytes | None) -> None:
        self._is_at_end = data == b""
        *lines, self._rest = (self._rest + (data or b"")).split(b"\n")
        if self._is_at_end:
            lines.append(self._rest)
        self._rest = self._rest[: MAX_LINE_CHARS + 1]  # one character too many is enough for the error
        self._lines += [line.decode(errors="replace") for line in lines if line.strip()]

    def _show(self, answer: CommandResult) -> None:
        try:
            print(visible(answer.text), file=self.factory.prints or sys.stdout, flush=True)
        except (OSError, ValueError):
            self.stop()  # the output is closed


def _select_and_read(descriptor: int) -> bytes | None:
    """Wait briefly for bytes; return None if none arrived, and b"" at the end."""
    try:
        is_ready, _, _ = select.select([descriptor], [], [], POLL_PERIOD_S)
        return os.read(descriptor, _READ_BYTES) if is_ready else None
    except OSError:  # the terminal was closed
        return b""


class _ThreadReader:
    """Reader for a terminal that cannot be selected, as on Windows: a thread that blocks and is left running.

    It reads the descriptor and not `sys.stdin`, whose lock it would hold while Python ends.
    """

    def __init__(self, descriptor: int) -> None:
        self._received: TimedQueue[bytes] = TimedQueue()
        threading.Thread(target=self._run, args=(descriptor,), name="stdin", daemon=True).start()

    def _run(self, descriptor: int) -> None:
        data = b"-"
        while data:
            try:
                data = os.read(descriptor, _READ_BYTES)
            except OSError:
                data = b""
            self._received.put(data)

    def __call__(self) -> bytes | None:
        try:
            return self._received.get(POLL_PERIOD_S)
        except Empty:
            return None
