"""Whole frames over a serial port, for a board of one's own: numbered, so that what was lost is known.

    frame --> number (0 to 255, then from 0 again), frame --> check sum, COBS, zero (wire/framing.py) --> port

The other end does the same; a page of C for it is `robots/urov/firmware/frames.c`.
"""

from __future__ import annotations

from snr_sim.devices.wire.framing import FrameReader, framed
from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.prelude.errors import CommandError

MOST_BYTES = 250  # of a frame: with number and check sum still one run of COBS


class NumberedFrames:
    """Frames over a port. Keeps the promise of SerialLink.

    Args:
        port: open.
    """

    def __init__(self, port: BytePort) -> None:
        self._port = port
        self._reader = FrameReader(most_bytes=MOST_BYTES + 5)
        self._sent = self._bytes = self._frames = self._gaps = 0
        self._next: int | None = None

    def send(self, frame: bytes) -> None:
        """Sends one frame of 0 to 250 bytes.

        Raises:
            CommandError: it is longer.
            DeviceError: the wire is gone.
        """
        if len(frame) > MOST_BYTES:
            raise CommandError(f"A frame of {len(frame)} bytes.", fix=f"at most {MOST_BYTES}: cut it in two.")
        self._port.write(framed(bytes([self._sent]) + frame))
        self._sent = (self._sent + 1) % 256

    def poll(self) -> list[bytes]:
        """Returns the whole frames that have come since.

        Raises:
            DeviceError: the wire is gone.
        """
        data = self._port.read()
        self._bytes += len(data)
        frames = []
        for body in self._reader.feed(data):
            if self._next is not None:
                self._gaps += (body[0] - self._next) % 256
            self._next = (body[0] + 1) % 256
            frames.append(body[1:])
        self._frames += len(frames)
        return frames

    def counts(self) -> dict[str, int]:
        """Returns what was counted: 'bytes', 'frames', 'crc_errors', 'gaps'."""
        damaged = self._reader.crc_errors + self._reader.overlong
        return {"bytes": self._bytes, "frames": self._frames, "crc_errors": damaged, "gaps": self._gaps}
