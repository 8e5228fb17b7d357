"""Line: a connection to one console, at the node's end. It never makes anybody wait."""

from __future__ import annotations

import selectors
import socket
import time
from contextlib import suppress

from snr_sim.console.conversation import Conversation

READ_BYTES = 1 << 14
# Who sends without end is read so slowly that it costs the node a few per cent of a core, whatever it sends.
BYTES_PER_S = 1 << 18
READS_PER_S = 1000.0
# How long a line that is over waits for the far end to hang up: closing earlier could take back what was sent.
HANG_UP_S = 0.5


class Line:
    """Reads at a bounded rate, writes what fits.

    Args:
        sock: connected.
        conversation: what is said on it.
        host: the far end's address.
    """

    def __init__(self, sock: socket.socket, conversation: Conversation, host: str) -> None:
        sock.setblocking(False)
        with suppress(OSError):  # not every family of sockets has it
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.sock = sock
        self.host = host
        self.conversation = conversation
        self.is_broken = False
        self.watched = 0  # what `select` waits for on its behalf
        self._resume_s = 0.0  # when to read again
        self._is_resting = False  # it could be read, but not yet
        self._leaves_s: float | None = None  # when it is closed at the latest, once it is over
        self._has_said_all = False

    @property
    def is_known(self) -> bool:
        """Whether it has shown that a console is there."""
        return self.conversation.wire.is_up

    @property
    def due_s(self) -> float:
        """When there is something to do although nothing happens."""
        resume_s = self._resume_s if self._is_resting else float("inf")
        return min(resume_s, self._leaves_s) if self._leaves_s is not None else resume_s

    def is_done(self, now_s: float) -> bool:
        """Whether it can be closed."""
        return self.is_broken or (self._leaves_s is not None and now_s >= self._leaves_s)

    def read(self) -> None:
        """Takes what has come."""
        try:
            data = self.sock.recv(READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        now_s = time.monotonic()
        self._resume_s = now_s + max(len(data) / BYTES_PER_S, 1 / READS_PER_S)
        if data:
            self.conversation.receive(data, now_s)
        else:
            self.is_broken = True

    def tend(self, now_s: float) -> int:
        """Answers and sends; returns what `select` is to wait for."""
        conversation = self.conversation
        conversation.work(now_s)
        self._write()
        if conversation.is_over:
            self._see_off(now_s)
        can_be_read = conversation.wants_bytes or conversation.is_over
        self._is_resting = can_be_read and now_s < self._resume_s
        is_read = can_be_read and not self._is_resting
        return (selectors.EVENT_READ if is_read else 0) | (selectors.EVENT_WRITE if conversation.output else 0)

    def _see_off(self, now_s: float) -> None:
        if self._leaves_s is None:
            self._leaves_s = now_s + HANG_UP_S
        if not (self.conversation.output or self._has_said_all):
            self._has_said_all = True
            with suppress(OSError):
                self.sock.shutdown(socket.SHUT_WR)

    def _write(self) -> None:
        output = self.conversation.output
        try:
            while output:
                del output[: self.sock.send(output)]
        except BlockingIOError:
            pass
        except OSError:
            self.is_broken = True
