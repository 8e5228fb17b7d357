"""Frames in a byte stream: each with a check sum, in COBS, ended by a zero. Other bytes are dropped and counted.

body --> body, CRC-16/XMODEM (high byte first) --> COBS --> a zero
"""

from __future__ import annotations

from binascii import crc_hqx

from snr_sim.devices.wire.cobs import CobsError
from snr_sim.devices.wire.cobs import decode as cobs_decode
from snr_sim.devices.wire.cobs import encode as cobs_encode

_CRC_BYTES = 2


def framed(body: bytes) -> bytes:
    """Return a body as the bytes of its frame, with the zero that ends it.

    >>> framed(bytes([3, 1, 0])).hex(" ")
    '03 03 01 03 6a 61 00'
    """
    return cobs_encode(body + crc_hqx(body, 0).to_bytes(_CRC_BYTES, "big")) + b"\0"


class FrameReader:
    """Decoder from bytes to bodies, for chunks of any size with other bytes among them. Never raises, never grows.

    Args:
        most_bytes: of a frame, between two zeros.

    Attributes:
        crc_errors: frames that were damaged: invalid COBS, or a wrong check sum.
        overlong: runs of bytes without a zero, longer than any frame: another baud rate, another device.
    """

    def __init__(self, most_bytes: int) -> None:
        self.crc_errors = self.overlong = 0
        self._most = most_bytes
        self._rest = bytearray()
        self._skips = False  # inside an overlong run

    def feed(self, data: bytes) -> list[bytes]:
        """Add received bytes; return the bodies that are complete, at least one byte long.

        >>> frames = FrameReader(96)
        >>> frames.feed(bytes.fromhex("99 99 00 03 03 01 03 6a")), frames.feed(bytes.fromhex("61 00"))
        ([], [b'\\x03\\x01\\x00'])
        >>> frames.crc_errors
        1
        """
        bodies: list[bytes] = []
        pieces = data.split(b"\0")
        last = len(pieces) - 1
        for i, piece in enumerate(pieces):
            if not self._skips:
                self._rest += piece[: self._most + 1]
                if len(self._rest) > self._most:
                    self._rest.clear()
                    self._skips = True
                    self.overlong += 1
            if i == last:
                break
            if self._rest:
                body = self._body(bytes(self._rest))
                self._rest.clear()
                if body is not None:
                    bodies.append(body)
            self._skips = False
        return bodies

    def _body(self, encoded: bytes) -> bytes | None:
        try:
            checked = cobs_decode(encoded)
        except CobsError:
            self.crc_errors += 1
            return None
        # The CRC over a body and its own CRC is zero.
        if len(checked) <= _CRC_BYTES or crc_hqx(checked, 0) != 0:
            self.crc_errors += 1
            return None
        return checked[:-_CRC_BYTES]
