"""Frames of a VESC motor controller's serial line as bytes, and back. `vesc_messages.py` has what they carry.

    02 length payload crc crc 03            of 1 to 255 bytes
    03 length length payload crc crc 03     of more; CRC-16/XMODEM of the payload; all numbers with the high byte first

Source: VESC firmware, `packet.c` and `crc.c`.
"""

from __future__ import annotations

import re
from binascii import crc_hqx
from typing import ClassVar

from snr_sim.devices.wire.frame_search import FrameSearch
from snr_sim.prelude.errors import CommandError

_SHORT, _LONG, _END = 2, 3, 3
_MAX_SHORT = 255  # bytes of a payload with one byte for its length
_TAIL_BYTES = 3  # the CRC and the end
_MIN_BYTES = 6  # of a frame
MAX_PAYLOAD = 1024  # the firmware's own limit is 512


def encode(payload: bytes) -> bytes:
    """Return a payload as the bytes of its frame; raise a CommandError if it is empty or has more than 1024 bytes.

    >>> encode(bytes([4])).hex(" ")
    '02 01 04 40 84 03'
    """
    size = len(payload)
    if not 1 <= size <= MAX_PAYLOAD:
        raise CommandError(f"A payload of {size} bytes does not fit into a frame.", fix=f"send 1 to {MAX_PAYLOAD}.")
    head = bytes([_SHORT, size]) if size <= _MAX_SHORT else bytes([_LONG]) + size.to_bytes(2, "big")
    return head + payload + _tail(payload)


class VescFrames(FrameSearch[bytes]):
    """Decoder from bytes to payloads; see `FrameSearch`.

    Args:
        max_payload: bytes; a longer frame is junk.
        gap_s: see `FrameSearch`; 115 200 baud send 230 bytes in the default.

    >>> frames = VescFrames()
    >>> frames.feed(bytes.fromhex("03 ff ff 02 01 04 40"), now_s=0.0), frames.feed(bytes.fromhex("84 03"), now_s=0.001)
    ([], [b'\\x04'])
    >>> frames.frames, frames.damaged, frames.skipped
    (1, 0, 3)
    """

    _START: ClassVar[re.Pattern[bytes]] = re.compile(rb"[\x02\x03]")

    def __init__(self, max_payload: int = MAX_PAYLOAD, gap_s: float = 0.02) -> None:
        super().__init__(gap_s)
        self._max_payload = max_payload

    def _size(self, received: bytes, start: int) -> int:
        head = received[start : start + 3]
        if len(head) < 3:
            return _MIN_BYTES
        if head[0] == _SHORT:
            size, head_bytes, fits = head[1], 2, head[1] >= 1
        else:
            size = int.from_bytes(head[1:], "big")
            head_bytes, fits = 3, size > _MAX_SHORT
        return head_bytes + size + _TAIL_BYTES if fits and size <= self._max_payload else 0

    def _open(self, frame: bytes) -> bytes | None:
        payload = frame[2 if frame[0] == _SHORT else 3 : -_TAIL_BYTES]
        # The end first: it is cheaper than the CRC, and junk seldom has it.
        return payload if frame[-1] == _END and frame[-_TAIL_BYTES:] == _tail(payload) else None


def _tail(payload: bytes) -> bytes:
    return crc_hqx(payload, 0).to_bytes(2, "big") + bytes([_END])
