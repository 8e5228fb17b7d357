"""A microcontroller without a board that answers a greeting, and says of itself what it is told to; nothing moves.

For tests of what a program makes of such an answer. What a board does, its firmware does under the emulator.
"""

from __future__ import annotations

import msgspec

from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import FromMcu, Hello, Ident, Telemetry, ToMcu


class McuGreeter:
    """The far end, and the port that leads to it. Keeps the promise of BytePort.

    Args:
        ident: who it says it is.
        telemetry: what it says of its state, with the session that it was greeted in.

    Attributes:
        heard: the messages that have come, in order.
        is_closed: whether the port was closed.
    """

    name = "/dev/ttyUSB0"

    def __init__(self, ident: Ident, telemetry: Telemetry) -> None:
        self.ident, self.telemetry = ident, telemetry
        self.heard: list[FromMcu | ToMcu] = []
        self.is_closed = False
        self._frames, self._answers = McuFrames(), b""

    def write(self, data: bytes) -> None:
        """Take bytes; answer each greeting among them."""
        for message in self._frames.feed(data):
            self.heard.append(message)
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
