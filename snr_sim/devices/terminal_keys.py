"""Keys typed at this program's terminal, without waiting for Enter. Ctrl-C and Ctrl-Z keep their effect."""

from __future__ import annotations

import os
import select
import sys
import time
from typing import Any

_READ_BYTES = 1024
_POLL_PERIOD_S = 0.02  # polling period of a Windows console, which has no blocking wait
_IS_WINDOWS = sys.platform == "win32"


class TerminalKeys:
    """The terminal of this program. Close it, or use it in a `with`; without a terminal there are no keys."""

    def __init__(self) -> None:
        self.is_there: bool = has_terminal()
        self._before: list[Any] | None = None
        if self.is_there and not _IS_WINDOWS:
            import termios
            import tty

            self._before = termios.tcgetattr(sys.stdin.fileno())
            tty.setcbreak(sys.stdin.fileno())

    def __enter__(self) -> TerminalKeys:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def typed(self) -> str:
        """Return the keys typed since the last call, without waiting."""
        typed = b""
        while self._is_ready(0.0):
            new = self._read()
            if not new:
                break  # the terminal was closed
            typed += new
        return typed.decode(errors="ignore")

    def wait(self, seconds: float) -> bool:
        """Wait until a key is typed or the time has passed; return whether one was typed."""
        if not self._is_ready(seconds):
            return False
        self._read()
        return True

    def close(self) -> None:
        """Restore the terminal's settings. Safe to call twice."""
        self.is_there = False
        if self._before is not None:
            import termios

            termios.tcsetattr(sys.stdin.fileno(), termios.TCSADRAIN, self._before)
            self._before = None

    def _is_ready(self, seconds: float) -> bool:
        if not self.is_there:
            time.sleep(seconds)
            return False
        if not _IS_WINDOWS:
            return bool(select.select([sys.stdin], [], [], seconds)[0])
        deadline_s = time.monotonic() + seconds
        while not _console().kbhit():
            if time.monotonic() >= deadline_s:
                return False
            time.sleep(_POLL_PERIOD_S)
        return True

    def _read(self) -> bytes:
        if not _IS_WINDOWS:
            return os.read(sys.stdin.fileno(), _READ_BYTES)
        key: bytes = _console().getwch().encode()
        return key


def has_terminal() -> bool:
    """Return whether a user can type keys for this program."""
    return sys.stdin is not None and not sys.stdin.closed and sys.stdin.isatty()


def _console() -> Any:
    import msvcrt

    return msvcrt
