"""Fake microcontroller that answers the handshake with given data and does nothing else.

For tests of a program's reaction to such an answer. Tests of the board itself run its firmware in the emulator.
"""

from __future__ import annotations

import msgspec

from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import FromMcu, Hello, Ident, Telemetry, ToMcu


class FakeMcu:
    """Remote end of the serial line, and the port that leads to it. Implements `BytePort`.

    Args:
        ident: the identity that it reports.
        telemetry: the state that it reports, with the session of the handshake.

    Attributes:
        received: the messages received, in order.
        is_closed: whether the port was closed.
    """

    name = "/dev/ttyUSB0"

    def __init__(self, ident: Ident, telemetry: Telemetry) -> None:
        self.ident: Ident = ident
        self.telemetry: Telemetry = telemetry
        self.received: list[FromMcu | ToMcu] = []
        self.is_closed: bool = False
        self._frames, self._answers = McuFrames(), b""

    def write(self, data: bytes) -> None:
        """Take bytes; answer each greeting among them."""
        for message in self._frames.feed(data):
            self.received.append(message)
            if isinstance(message, Hello):
                for answer in (self.ident, self.telemetry):
                    self._answers += encode(msgspec.structs.replace(answer, session=message.session))

    def read(self) -> bytes:
        """Return the answers so far."""
        answers, self._answers = self._answers, b""
        return answers

    def wait(self, seconds: float) -> bool:
        """Return whether there are answers; more do not come by waiting."""
        return bool(self._answers)

    def close(self) -> None:
        """Remember it."""
        self.is_closed = True
