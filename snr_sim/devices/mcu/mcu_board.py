"""The microcontroller's board as the computer sees it: one owner of the port, shared by all devices on the board.

McuPwm --.                       .--> handshake (mcu_handshake.py)
McuPower --> McuBoard --> port --+
                                 '--> telemetry, answers
"""

from __future__ import annotations

import os
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from snr_sim.devices.mcu.mcu_handshake import handshake
from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import CommandAck, Disarm, FromMcu, Ident, Telemetry, ToMcu
from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.prelude.errors import DeviceError, SnrError

TIMEOUT_S = 4.0  # for the first answer: opening the port resets most boards, whose boot loaders take up to 2 s
SILENT_S = 0.25  # telemetry comes at least every 50 ms; without it a wire is pulled
_FIRST_TELEMETRY_S = 0.5


class McuBoard:
    """Opens the port for the first device that needs it, and closes it after the last one. Thread-safe.

    Args:
        open_port: opens the port.
        now_s: the clock that stamps readings.
        line_s: the clock of the wire; the computer's for a real one.
        timeout_s: how long to wait for the answer to a greeting.
        session: the number of the first greeting; random if not given, because two programs must not use the same.

    Attributes:
        ident: identity of the board that answered; None if none has.
        telemetry: the newest.
        measured_s: when it arrived, by `now_s`.
        fault: as text, why the port is not open.
    """

    def __init__(
        self,
        open_port: Callable[[], BytePort],
        now_s: Callable[[], float],
        line_s: Callable[[], float] = time.monotonic,
        timeout_s: float = TIMEOUT_S,
        session: int | None = None,
    ) -> None:
        self._open_port = open_port
        self.now_s: Callable[[], float] = now_s
        self._line_s = line_s
        self._timeout_s = timeout_s
        self.session: int = int.from_bytes(os.urandom(2)) % 0xFFFF if session is None else session - 1
        self.ident: Ident | None = None
        self.telemetry: Telemetry | None = None
        self.measured_s: float | None = None
        self.fault: str = "The microcontroller's port has not been opened."
        self.name: str = "the microcontroller"
        self._received_s = 0.0
        self._port: BytePort | None = None
        self._frames = McuFrames()
        self._messages: deque[FromMcu] = deque(maxlen=64)
        self._users: set[int] = set()
        self._finalizer: weakref.finalize[..., McuBoard] | None = None
        self._lock = threading.RLock()
        self._reopened = -1

    @property
    def is_open(self) -> bool:
        """Whether a board answered and the wire has not been lost since."""
        return self._port is not None

    @property
    def silent_s(self) -> float:
        """Time in seconds since the last received byte."""
        return self._line_s() - self._received_s

    def open(self, user: object) -> Ident:
        """Open the port and greet, if not done yet, for a device that needs it.

        Raises:
            DeviceError: the port cannot be opened, no device answers, or another one does.
        """
        with self._lock:
            self._users.add(id(user))
            if self._port is None or self.ident is None:
                self._handshake()
            assert self.ident is not None
            return self.ident

    def release(self, user: object) -> None:
        """Release the board for one device. Safe to call twice."""
        with self._lock:
            self._users.discard(id(user))
            if not self._users:
                self.mark_lost(f"{self.name} was closed.")

    def send(self, message: ToMcu) -> None:
        """Send a message. A wire that is gone raises a DeviceError and closes the port."""
        with self._open_wire() as port:
            port.write(encode(message))

    def poll(self) -> None:
        """Process the bytes that have arrived; errors as in `send`."""
        with self._open_wire() as port:
            self._take(port.read())

    def take_messages(self) -> list[FromMcu]:
        """Return the messages since the last call, for the one device that acts."""
        with self._lock:
            messages = list(self._messages)
            self._messages.clear()
            return messages

    def mark_lost(self, reason: str) -> None:
        """Close the port. Never raises."""
        with self._lock:
            port, self._port = self._port, None
            self.fault = reason
            self._messages.clear()
            if self._finalizer is not None:
                self._finalizer.detach()
            if port is not None:
                port.close()

    def counts(self) -> dict[str, int]:
        """Return the counters: 'bytes', 'frames', 'crc_errors', 'gaps' at this end, 'reopened', 'silent_ms'.

        'crc_errors_at_mcu' are frames that reached the microcontroller damaged.
        """
        frames = self._frames
        there = {} if self.telemetry is None else {"crc_errors_at_mcu": self.telemetry.crc_errors}
        return {
            "bytes": frames.received_bytes,
            "frames": frames.frames,
            "crc_errors": frames.crc_errors + frames.oversized,
            "gaps": frames.gaps,
            "reopened": max(0, self._reopened),
            "silent_ms": int(self.silent_s * 1e3) if self.is_open else 0,
            **there,
        }

    def _handshake(self) -> None:
        port = self._open_port()
        self.name = port.name
        self._reopened += 1
        self._frames.resync()
        self.session = self.session % 0xFFFF + 1
        self.telemetry = None
        try:
            self.ident, after = handshake(port, self._frames, self.session, self._timeout_s, self._line_s)
            self._port = port
            self._finalizer = weakref.finalize(self, _send_close, port, self.session)
            self._received_s = self._line_s()
            for message in after:
                self._note(message)
            while self.telemetry is None and self.silent_s < _FIRST_TELEMETRY_S:
                port.wait(_FIRST_TELEMETRY_S)
                self._take(port.read())
        except BaseException as error:
            self._port = port  # to be closed in the same way
            self.mark_lost(str(error))
            raise

    def _take(self, data: bytes) -> None:
        for message in self._frames.feed(data):
            if isinstance(message, Telemetry | CommandAck):
                self._note(message)

    def _note(self, message: FromMcu) -> None:
        self._received_s = self._line_s()
        self._messages.append(message)
        if isinstance(message, Telemetry):
            self.telemetry, self.measured_s = message, self.now_s()

    @contextmanager
    def _open_wire(self) -> Iterator[BytePort]:
        with self._lock:
            if self._port is None:
                raise DeviceError(self.fault)
            try:
                yield self._port
            except DeviceError as error:
                self.mark_lost(str(error))
                raise


def _send_close(port: BytePort, session: int) -> None:
    """Disarm at exit of a program that did not close or dropped its devices: the lease lasts longer."""
    with suppress(SnrError):
        port.write(encode(Disarm(session)))
    port.close()
