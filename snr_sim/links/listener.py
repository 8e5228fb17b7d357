"""A socket that listens, in a selector: takes connections, and rests when the system has no descriptor left."""

from __future__ import annotations

import logging
import selectors
import socket
from contextlib import suppress
from typing import Any

from snr_sim.core.component import ComponentLog

PAUSE_S = 0.5


class Listener:
    """Waits for connections.

    Args:
        sock: listens already, and does not block.
        selector: that somebody looks after.
        log: is told why it rests.
        data: what the selector says with it.
    """

    def __init__(
        self,
        sock: socket.socket,
        selector: selectors.BaseSelector,
        log: logging.Logger | ComponentLog,
        data: Any = None,
    ) -> None:
        self.sock = sock
        self._selector = selector
        self._log = log
        self._data = data
        self._rests_until_s: float | None = None
        self._register()

    def _register(self) -> None:
        self._selector.register(self.sock, selectors.EVENT_READ, self._data)

    def accept(self, now_s: float) -> tuple[socket.socket, Any] | None:
        """Return a connection and its address, or None: there is none after all, or none can be taken now."""
        try:
            return self.sock.accept()
        except BlockingIOError:
            return None
        except ConnectionError:  # who called has gone again, which is no reason to keep others waiting
            return None
        except OSError as error:  # no descriptor left: accepting at once again would only spin
            self._log.warning("cannot take a connection: %s", error.strerror)
            self._selector.unregister(self.sock)
            self._rests_until_s = now_s + PAUSE_S
            return None

    def tend(self, now_s: float) -> None:
        """Go on, if it has rested."""
        if self._rests_until_s is not None and now_s >= self._rests_until_s:
            self._rests_until_s = None
            self._register()

    def close(self) -> None:
        """Take nobody any more. Safe to call twice."""
        with suppress(KeyError, ValueError):  # it rests, or is closed
            self._selector.unregister(self.sock)
        self.sock.close()
