"""Frames: a stream of bytes divided into messages. Four bytes of length (big-endian), then as many bytes.

Owns no port: bytes in, frames out. So split frames, invalid bytes and floods can be tested without a socket.

Message authentication codes (MACs) detect frames that are added, changed, removed, moved or repeated. Each direction of
a session has a key of its own, and numbers its frames. The numbers are not sent: a stream keeps its order, so both ends
count. A page costs each end less than 1 us.
"""

from __future__ import annotations

import struct
from hashlib import blake2b
from hmac import compare_digest

from snr_sim.prelude.errors import FrameTooLargeError

MAX_FRAME_BYTES = 1 << 20  # default limit of a payload
MAC_BYTES = 16  # after the message in a payload, where both ends have a secret
FRAME_BYTES_LIMIT = (1 << 32) - 1 - MAC_BYTES  # limit of a message: the largest that the length field can hold
_LENGTH = struct.Struct(">I")
HEADER_BYTES = _LENGTH.size
_NUMBER = struct.Struct(">Q").pack
_NUMBER_AND_LENGTH = struct.Struct(">QI").pack
# First bytes of a TLS record: an alert or a handshake, and the version (RFC 8446, section 5.1).
_TLS_RECORDS, _TLS_MAJOR = (21, 22), 3


def encode_frame(payload: bytes, max_bytes: int = MAX_FRAME_BYTES) -> bytes:
    """Return length and payload in one piece, so that one send suffices.

    Raises:
        FrameTooLargeError: the payload is longer than `max_bytes`.

    >>> encode_frame(b"hi")
    b'\\x00\\x00\\x00\\x02hi'
    """
    if len(payload) > max_bytes:
        raise FrameTooLargeError(
            f"A message of {len(payload)} bytes is more than a frame of this link may hold ({max_bytes}).",
            fix=f"send less at a time, or raise max_frame_bytes on both ends to {len(payload)} or more.",
        )
    return _LENGTH.pack(len(payload)) + payload


class LengthPrefixedReader:
    """Reads payloads from bytes, however the bytes are split. `max_bytes` may be changed between frames."""

    def __init__(self, max_bytes: int = MAX_FRAME_BYTES) -> None:
        self.max_bytes: int = max_bytes
        self._rest = bytearray()  # bytes without a complete frame: at most a frame and one read

    def feed(self, data: bytes = b"", at_most: int | None = None) -> list[bytes]:
        """Take bytes as they arrive; return the complete payloads, at most `at_most`.

        Raises:
            FrameTooLargeError: the next frame announces more than `max_bytes`. The reader cannot recover: the sender
                does not use this protocol.

        >>> reader = LengthPrefixedReader()
        >>> reader.feed(b"\\x00\\x00\\x00\\x02h"), reader.feed(b"i\\x00")
        ([], [b'hi'])
        """
        rest = self._rest
        if rest:
            rest += data  # grows in place: a long frame in a thousand reads is copied twice, not a thousand times
            if len(rest) < self._required_bytes():
                return []
            data = bytes(rest)
            rest.clear()
        start, end, read_length = 0, len(data), _LENGTH.unpack_from
        if end > HEADER_BYTES and end - HEADER_BYTES == read_length(data)[0] <= self.max_bytes:
            return [data[HEADER_BYTES:]]  # exactly one frame, as nearly always when pages arrive one at a time
        frames: list[bytes] = []
        while end - start >= HEADER_BYTES and (at_most is None or len(frames) < at_most):
            (length,) = read_length(data, start)
            if length > self.max_bytes:
                if not frames:
                    raise self._too_large(data[start : start + HEADER_BYTES], length)
                break  # first return those that arrived before it
            stop = start + HEADER_BYTES + length
            if stop > end:
                break
            frames.append(data[start + HEADER_BYTES : stop])
            start = stop
        rest += data[start:]
        return frames

    @property
    def missing_bytes(self) -> int:
        """Number of bytes of an incomplete frame that are still missing, as far as its length is known."""
        return self._required_bytes() - len(self._rest) if self._rest else 0

    def _required_bytes(self) -> int:
        """Return the number of bytes required before the next attempt to decode."""
        if len(self._rest) < HEADER_BYTES:
            return HEADER_BYTES
        length: int = _LENGTH.unpack_from(self._rest)[0]
        return HEADER_BYTES if length > self.max_bytes else HEADER_BYTES + length

    def _too_large(self, header: bytes, length: int) -> FrameTooLargeError:
        if header[0] in _TLS_RECORDS and header[1] == _TLS_MAJOR:
            return FrameTooLargeError(
                "The other end speaks TLS, this one does not.",
                fix="tls=Tls(...) on both ends.",
            )
        if header.isascii() and header.decode().isprintable():
            return FrameTooLargeError(
                f"The other end began a message with the text {header.decode()!r}: it does not speak this protocol.",
                fix="is that a browser, or another program's port? Both ends must be nodes.",
            )
        return FrameTooLargeError(
            f"The other end announced a message of {length} bytes; at most {self.max_bytes} are taken here.",
            fix="if it is a page that large, raise max_frame_bytes on both ends.",
        )


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
        return _LENGTH.pack(len(frame) - HEADER_BYTES + MAC_BYTES) + frame[HEADER_BYTES:] + mac.digest()

    def open(self, payload: bytes) -> bytes | None:
        """Return the message in a payload; None if it is not the next one that was sent."""
        number = self._number
        self._number = number + 1
        message = payload[:-MAC_BYTES]
        mac = self._keyed.copy()
        mac.update(_NUMBER_AND_LENGTH(number, len(message)) + message)
        return message if compare_digest(mac.digest(), payload[-MAC_BYTES:]) else None
