"""Frames: how a stream of bytes is cut into messages. Four bytes of length (big-endian), then as many bytes.

Owns no port: bytes in, frames out. So splitting, nonsense and floods can all be tried without a socket.
"""

from __future__ import annotations

import struct

from snr_sim.prelude.errors import FrameTooLarge

MAX_FRAME_BYTES = 1 << 20  # of a payload, if nobody says otherwise
MAC_BYTES = 16  # behind the message in a payload, where both ends have a secret: see frame_mac.py
MOST_FRAME_BYTES = (1 << 32) - 1 - MAC_BYTES  # of a message: what the length can say
_LENGTH = struct.Struct(">I")
HEADER_BYTES = _LENGTH.size
# With these a TLS record begins: an alert or a handshake, and the version (RFC 8446, section 5.1).
_TLS_RECORDS, _TLS_MAJOR = (21, 22), 3


def encode_frame(payload: bytes, max_bytes: int = MAX_FRAME_BYTES) -> bytes:
    """Return length and payload in one piece, so that one send carries them.

    Raises:
        FrameTooLarge: the payload is longer than `max_bytes`.

    >>> encode_frame(b"hi")
    b'\\x00\\x00\\x00\\x02hi'
    """
    if len(payload) > max_bytes:
        raise FrameTooLarge(
            f"A message of {len(payload)} bytes is more than a frame of this link may hold ({max_bytes}).",
            fix=f"send less at a time, or raise max_frame_bytes on both ends to {len(payload)} or more.",
        )
    return _LENGTH.pack(len(payload)) + payload


class FrameReader:
    """Bytes in, payloads out, however the bytes are cut.

    Args:
        max_bytes: the longest payload; may be changed between frames.
    """

    def __init__(self, max_bytes: int = MAX_FRAME_BYTES) -> None:
        self.max_bytes = max_bytes
        self._rest = bytearray()  # what no frame has been made of yet: at most a frame and one read

    def feed(self, data: bytes = b"", at_most: int | None = None) -> list[bytes]:
        """Take bytes as they come; return the payloads that are complete, at most so many.

        Raises:
            FrameTooLarge: the next frame announces more than `max_bytes`. Nothing of it is waited for, and there is
                no way on: whoever counts that high does not speak this protocol.

        >>> reader = FrameReader()
        >>> reader.feed(b"\\x00\\x00\\x00\\x02h"), reader.feed(b"i\\x00")
        ([], [b'hi'])
        """
        rest = self._rest
        if rest:
            rest += data  # grows in place: a long frame in a thousand reads is copied twice, not a thousand times
            if len(rest) < self._wanted():
                return []
            data = bytes(rest)
            rest.clear()
        start, end, read_length = 0, len(data), _LENGTH.unpack_from
        if end > HEADER_BYTES and end - HEADER_BYTES == read_length(data)[0] <= self.max_bytes:
            return [data[HEADER_BYTES:]]  # one frame and nothing else, as nearly always when pages come singly
        frames: list[bytes] = []
        while end - start >= HEADER_BYTES and (at_most is None or len(frames) < at_most):
            (length,) = read_length(data, start)
            if length > self.max_bytes:
                if not frames:
                    raise self._too_large(data[start : start + HEADER_BYTES], length)
                break  # first those that came before it
            stop = start + HEADER_BYTES + length
            if stop > end:
                break
            frames.append(data[start + HEADER_BYTES : stop])
            start = stop
        rest += data[start:]
        return frames

    @property
    def missing_bytes(self) -> int:
        """How many bytes of the frame that has begun are still to come, as far as its length is known."""
        return self._wanted() - len(self._rest) if self._rest else 0

    def _wanted(self) -> int:
        """How many bytes there must be before looking is worth while."""
        if len(self._rest) < HEADER_BYTES:
            return HEADER_BYTES
        length: int = _LENGTH.unpack_from(self._rest)[0]
        return HEADER_BYTES if length > self.max_bytes else HEADER_BYTES + length

    def _too_large(self, header: bytes, length: int) -> FrameTooLarge:
        if header[0] in _TLS_RECORDS and header[1] == _TLS_MAJOR:
            return FrameTooLarge(
                "The other end speaks TLS, this one does not.",
                fix="tls=Tls(...) on both ends.",
            )
        if header.isascii() and header.decode().isprintable():
            return FrameTooLarge(
                f"The other end began a message with the text {header.decode()!r}: it does not speak this protocol.",
                fix="is that a browser, or another program's port? Both ends must be nodes.",
            )
        return FrameTooLarge(
            f"The other end announced a message of {length} bytes; at most {self.max_bytes} are taken here.",
            fix="if it is a page that large, raise max_frame_bytes on both ends.",
        )
