"""Keys as they are pressed, at a terminal: Ctrl-C and Ctrl-Z stay what they are."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from typing import Any


class Keys:
    """The terminal of this program; use it in a `with`. Where there is none, no key is ever pressed."""

    def __enter__(self) -> Keys:
        self._kept: list[Any] | None = None
        if sys.stdin.isatty():
            self._kept = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        return self

    def __exit__(self, *_: object) -> None:
        if self._kept is not None:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._kept)

    def wait(self, seconds: float) -> bool:
        """Waits so long, or until a key is pressed, and returns whether one was."""
        if self._kept is None:
            select.select([], [], [], seconds)
            return False
        if not select.select([sys.stdin], [], [], seconds)[0]:
            return False
        os.read(sys.stdin.fileno(), 1024)
        return True
