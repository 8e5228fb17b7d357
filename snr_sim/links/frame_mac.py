"""Message authentication codes (MACs) of frames: detect frames that are added, changed, removed, moved or repeated.

Each direction of a session has a key of its own, and numbers its frames. The numbers are not sent: a stream keeps its
order, so both ends count. A page costs each end less than 1 us.
"""

from __future__ import annotations

import struct
from hashlib import blake2b
from hmac import compare_digest

from snr_sim.links.frames import HEADER_BYTES, MAC_BYTES

_LENGTH = struct.Struct(">I").pack
_NUMBER = struct.Struct(">Q").pack
_NUMBER_AND_LENGTH = struct.Struct(">QI").pack


class FrameMac:
    """The MACs of one direction of one session, by a key of its own.

    >>> there, here = FrameMac(b"k" * 32), FrameMac(b"k" * 32)
    >>> frame = there.seal(b"\\x00\\x00\\x00\\x02hi")
    >>> here.open(frame[4:]), here.open(frame[4:])
    (b'hi', None)
    """

    __slots__ = ("_keyed", "_number")

    def __init__(self, key: bytes) -> None:
        self._keyed = blake2b(key=key, digest_size=MAC_BYTES)  # copying it costs a third of making a new one
        self._number = 0

    def seal(self, frame: bytes) -> bytes:
        """Return a frame with its MAC. Call it once per frame, in the order of sending."""
        number = self._number
        self._number = number + 1
        mac = self._keyed.copy()
        mac.update(_NUMBER(number) + frame)
        return _LENGTH(len(frame) - HEADER_BYTES + MAC_BYTES) + frame[HEADER_BYTES:] + mac.digest()

    def open(self, payload: bytes) -> bytes | None:
        """Return the message in a payload; None if it is not the next one that was sent."""
        number = self._number
        self._number = number + 1
        message = payload[:-MAC_BYTES]
        mac = self._keyed.copy()
        mac.update(_NUMBER_AND_LENGTH(number, len(message)) + message)
        return message if compare_digest(mac.digest(), payload[-MAC_BYTES:]) else None
