"""A port to a child process: messages in both directions; its end looks like a pulled cable."""

from __future__ import annotations

import select
import subprocess
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Generic, TypeVar

from snr_sim.core.process.spawn import describe_exit, start_process
from snr_sim.prelude.errors import DeviceError

END_S = 5.0

Message = TypeVar("Message")


class ChildPort(Generic[Message]):
    """A new Python process that runs one function of the library. Only `wait` and `close` block.

    It has its own process group, so that Ctrl-C at a terminal does not reach it. When this program ends in any way, its
    line closes.

    Args:
        target: "module:function", called there with its end of the Connection.
        receive: returns the next message from a Connection. A message is far shorter than the pipe's buffer.
    """

    def __init__(self, target: str, receive: Callable[[Connection], Message]) -> None:
        self._process, self._line = start_process(target)
        self._receive = receive
        self.name = f"process {self.pid}"

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def write(self, message: bytes) -> None:
        """Send a message.

        Raises:
            DeviceError: the process has ended, or does not read.
        """
        if not select.select([], [self._line], [], 0)[1]:
            raise DeviceError(f"The {self.name} does not read its input: it hangs.", fix=f"kill -9 {self.pid}")
        try:
            self._line.send_bytes(message)
        except OSError as error:
            raise self._ended() from error

    def read(self) -> list[Message]:
        """Return the messages that have arrived.

        Raises:
            DeviceError: the process has ended.
        """
        messages: list[Message] = []
        try:
            while self._line.poll():
                messages.append(self._receive(self._line))
        except (EOFError, OSError) as error:
            if not messages:
                raise self._ended() from error
        return messages

    def wait(self, seconds: float) -> bool:
        """Return whether a message, or the end of the process, has arrived."""
        return self._line.poll(seconds)

    def close(self) -> None:
        """Close its line, which ends the process."""
        self._line.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _ended(self) -> DeviceError:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(END_S)
        status = self._process.returncode
        how = "ended its line" if status is None else describe_exit(status)
        return DeviceError(
            f"The {self.name} {how}.", fix="read its output above; `dmesg | tail` shows whether memory ran out."
        )
