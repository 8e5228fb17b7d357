"""Frames in a byte stream: each with a check sum, in COBS, ended by a zero. Other bytes are dropped and counted.

body --> body, CRC-16/XMODEM (high byte first) --> COBS --> a zero
"""

from __future__ import annotations

from binascii import crc_hqx

from snr_sim.devices.wire.cobs import CobsError
from snr_sim.devices.wire.cobs import decode as cobs_decode
from snr_sim.devices.wire.cobs import encode as cobs_encode

_CRC_BYTES = 2


def encode_frame(body: bytes) -> bytes:
    """Return a body as the bytes of its frame, with the zero that ends it.

    >>> encode_frame(bytes([3, 1, 0])).hex(" ")
    '03 03 01 03 6a 61 00'
    """
    return cobs_encode(body + crc_hqx(body, 0).to_bytes(_CRC_BYTES, "big")) + b"\0"


class CobsFrameReader:
    """Decoder from bytes to bodies, for chunks of any size with other bytes among them. Never raises, never grows.

    Args:
        max_bytes: of a frame, between two zeros.

    Attributes:
        crc_errors: frames that were damaged: invalid COBS, or a wrong check sum.
        oversized: runs of bytes without a zero, longer than any frame: another baud rate, another device.
    """

    def __init__(self, max_bytes: int) -> None:
        self.crc_errors = self.oversized = 0
        self._max_bytes = max_bytes
        self._rest = bytearray()
        self._is_skipping = False  # inside an oversized run

    def feed(self, data: bytes) -> list[bytes]:
        """Add received bytes; return the bodies that are complete, at least one byte long.

        >>> frames = CobsFrameReader(96)
        >>> frames.feed(bytes.fromhex("99 99 00 03 03 01 03 6a")), frames.feed(bytes.fromhex("61 00"))
        ([], [b'\\x03\\x01\\x00'])
        >>> frames.crc_errors
        1
        """
        bodies: list[bytes] = []
        pieces = data.split(b"\0")
        last = len(pieces) - 1
        for i, piece in enumerate(pieces):
            if not self._is_skipping:
                self._rest += piece[: self._max_bytes + 1]
                if len(self._rest) > self._max_bytes:
                    self._rest.clear()
                    self._is_skipping = True
                    self.oversized += 1
            if i == last:
                break
            if self._rest:
                body = self._body(bytes(self._rest))
                self._rest.clear()
                if body is not None:
                    bodies.append(body)
            self._is_skipping = False
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
