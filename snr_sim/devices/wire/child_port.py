"""A port to a process of our own: bytes to it and from it, and the end of it as a cable that was pulled."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
from contextlib import suppress

from snr_sim.core.process import spawned
from snr_sim.prelude.errors import DeviceError

END_S = 5.0


class ChildPort:
    """A fresh Python that runs one function of the kit. Keeps the promise of BytePort.

    It is in a group of its own, so that Ctrl-C at a terminal does not reach it; it sees the end of this program,
    however that comes, as the end of its line.

    Args:
        target: "module:function", called there with the Connection to here.
    """

    def __init__(self, target: str) -> None:
        near, far = socket.socketpair()
        with far:
            self._process = subprocess.Popen(
                [sys.executable, "-c", spawned.command(target, far.fileno())],
                stdin=subprocess.DEVNULL,
                pass_fds=(far.fileno(),),
                process_group=0,
            )
        near.setblocking(False)
        self._line = near
        self.name = f"process {self.pid}"

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid

    def write(self, data: bytes) -> None:
        """Sends bytes."""
        try:
            sent = self._line.send(data)
        except BlockingIOError:
            sent = 0
        except OSError as error:
            raise self._ended() from error
        if sent != len(data):
            raise DeviceError(f"The {self.name} does not read what it is sent: it hangs.", fix=f"kill -9 {self.pid}")

    def read(self) -> bytes:
        """Returns what has come."""
        try:
            data = self._line.recv(65536)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._ended() from error
        if not data:
            raise self._ended()
        return data

    def wait(self, seconds: float) -> bool:
        """Returns whether bytes have come, or the end."""
        return bool(select.select([self._line], [], [], seconds)[0])

    def close(self) -> None:
        """Ends its line, and so it."""
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
        how = "ended its line" if status is None else f"ended with status {status}"
        if status is not None and status < 0:
            with suppress(ValueError):
                how = f"was killed by {signal.Signals(-status).name}"
        return DeviceError(
            f"The {self.name} {how}.", fix="what it printed stands above; `dmesg | tail` tells of memory."
        )


def send_all(fd: int, data: bytes) -> None:
    """Writes to a line from inside of such a process.

    Raises:
        OSError: nobody is there any more.
    """
    while data:
        data = data[os.write(fd, data) :]
