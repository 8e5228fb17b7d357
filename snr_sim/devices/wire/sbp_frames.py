"""Frames of the Swift Binary Protocol as bytes, and back. `sbp_messages.py` has what they carry.

    55 type type sender sender length payload crc crc       CRC-16/XMODEM of type to payload; low bytes first

Source: Swift Navigation, "Swift Binary Protocol"; the tests compare with the maker's package `sbp`.
"""

from __future__ import annotations

import re
import struct
from binascii import crc_hqx
from typing import ClassVar, NamedTuple

from snr_sim.devices.wire.frame_search import FrameSearch

_HEAD = struct.Struct("<BHHB")
_PREAMBLE = 0x55
_CRC_BYTES = 2


class SbpFrame(NamedTuple):
    """Content of a frame."""

    kind: int  # type of the message
    payload: bytes  # up to 255 bytes
    sender: int = 0x42  # of a device: half of its serial number. 0x42: a program on a computer


def encode(frame: SbpFrame) -> bytes:
    """Return a frame as bytes.

    >>> encode(SbpFrame(0xFFFF, bytes(4), sender=0x88BF)).hex(" ")  # a heartbeat
    '55 ff ff bf 88 04 00 00 00 00 8b 30'
    """
    checked = _HEAD.pack(_PREAMBLE, frame.kind, frame.sender, len(frame.payload)) + frame.payload
    return checked + _crc(checked)


class SbpFrames(FrameSearch[SbpFrame]):
    """Decoder from bytes to frames; see `FrameSearch`."""

    _START: ClassVar[re.Pattern[bytes]] = re.compile(b"\x55")

    def __init__(self, gap_s: float = 0.05) -> None:
        super().__init__(gap_s)

    def _size(self, received: bytes, start: int) -> int:
        head = received[start : start + _HEAD.size]
        return _HEAD.size + (head[-1] if len(head) == _HEAD.size else 0) + _CRC_BYTES

    def _open(self, frame: bytes) -> SbpFrame | None:
        if frame[-_CRC_BYTES:] != _crc(frame[:-_CRC_BYTES]):
            return None
        _, kind, sender, _ = _HEAD.unpack_from(frame)
        return SbpFrame(kind, frame[_HEAD.size : -_CRC_BYTES], sender)


def _crc(frame: bytes) -> bytes:
    """Return the check sum of a frame without its own."""
    return crc_hqx(frame[1:], 0).to_bytes(_CRC_BYTES, "little")
