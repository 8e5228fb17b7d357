"""A listening socket in a selector: accepts connections, and pauses when the system has no descriptor left."""

from __future__ import annotations

import logging
import selectors
import socket
from contextlib import suppress
from typing import Any

from snr_sim.core.component import ComponentLog

PAUSE_S = 0.5


class Listener:
    """Accepts connections.

    Args:
        sock: a listening, non-blocking socket.
        selector: registers the socket; its owner polls it.
        log: receives the reason of a pause.
        data: what the selector returns with the socket.
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
        """Return a connection and its address, or None if there is none or none can be accepted now."""
        try:
            return self.sock.accept()
        except BlockingIOError:
            return None
        except ConnectionError:  # the caller has gone again, which must not delay others
            return None
        except OSError as error:  # no descriptor left: an immediate retry would only spin
            self._log.warning("cannot take a connection: %s", error.strerror)
            self._selector.unregister(self.sock)
            self._rests_until_s = now_s + PAUSE_S
            return None

    def resume(self, now_s: float) -> None:
        """Resume after a pause, if it is over."""
        if self._rests_until_s is not None and now_s >= self._rests_until_s:
            self._rests_until_s = None
            self._register()

    def close(self) -> None:
        """Accept no more connections. Safe to call twice."""
        with suppress(KeyError, ValueError):  # paused, or closed
            self._selector.unregister(self.sock)
        self.sock.close()
