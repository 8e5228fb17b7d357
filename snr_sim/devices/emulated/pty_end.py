"""The far ends of serial cables: pseudo terminals, for emulated devices in real time. Linux and macOS.

A pseudo terminal differs from a cable: it has no baud rate, no DTR that resets an Arduino and no noise.
"""

from __future__ import annotations

import os
import signal
import tty
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import FrameType


class PtyEnd:
    """A device's end of a terminal.

    Args:
        link: path of a link to the terminal; removed at the end.
    """

    def __init__(self, link: Path) -> None:
        self._link = link
        self._end, self._far_end = os.openpty()
        tty.setraw(self._far_end)
        os.set_blocking(self._end, False)
        # Kept open: a terminal that is not open anywhere loses its buffer, and reading from it fails.
        self.path: str = os.ttyname(self._far_end)
        link.unlink(missing_ok=True)
        link.symlink_to(self.path)

    def fileno(self) -> int:
        """Return the descriptor, to wait for bytes."""
        return self._end

    def read(self, count: int = 4096) -> bytes:
        """Return the bytes that the computer has sent, which may be none."""
        with suppress(BlockingIOError):
            return os.read(self._end, count)
        return b""

    def write(self, data: bytes) -> None:
        """Send bytes to the computer. Without a reader they are lost, as on a cable."""
        if data:
            with suppress(BlockingIOError):
                os.write(self._end, data)

    def close(self) -> None:
        """Close the terminal, and remove the link unless it is another one's by now."""
        with suppress(FileNotFoundError):
            if str(self._link.readlink()) == self.path:
                self._link.unlink()
        os.close(self._end)
        os.close(self._far_end)


def until_ended() -> Callable[[], bool]:
    """Return a function that is true until SIGTERM or SIGINT arrives, or the parent process ends."""
    parent, is_ended = os.getppid(), False

    def end(_number: int, _frame: FrameType | None) -> None:
        nonlocal is_ended
        is_ended = True

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGINT, end)
    return lambda: not is_ended and os.getppid() == parent
