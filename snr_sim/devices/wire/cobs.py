"""COBS: encodes bytes without zeros, so that a zero can mark the end of a frame.

A receiver that starts in the middle or misses a byte is synchronised again at the next zero. Overhead: 1 byte in 254.

Source: S. Cheshire, M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on Networking 7 (1999).
"""

from __future__ import annotations

from snr_sim.prelude.errors import DeviceError

_LONGEST = 254  # bytes without a zero that one count can cover


class CobsError(DeviceError):
    """Bytes that an encoder cannot produce."""


def encode(data: bytes) -> bytes:
    """Return the data without zeros: each run of other bytes starts with the distance to the next zero.

    The zero that ends the frame is not among them.

    >>> encode(b"\\x11\\x00\\x22").hex(" ")
    '02 11 02 22'
    """
    encoded = bytearray()
    is_full = False
    for run in data.split(b"\0"):
        start, is_full = 0, False
        while len(run) - start >= _LONGEST:
            encoded.append(_LONGEST + 1)  # 255: as many bytes, and no zero after them
            encoded += run[start : start + _LONGEST]
            start += _LONGEST
            is_full = start == len(run)
        encoded.append(len(run) - start + 1)
        encoded += run[start:]
    if is_full:
        encoded.pop()  # the data ended with a full run of 254 bytes: the last count is not needed
    return bytes(encoded)


def decode(encoded: bytes) -> bytes:
    """Return the decoded bytes; raise a CobsError at a zero, or a count that points beyond the end.

    >>> decode(bytes.fromhex("02 11 02 22")).hex(" ")
    '11 00 22'
    """
    if 0 in encoded:
        raise CobsError(f"A frame of {len(encoded)} bytes contains a zero.")
    data = bytearray()
    at, end = 0, len(encoded)
    while at < end:
        count = encoded[at]
        if at + count > end:
            raise CobsError(f"Byte {at} of a frame announces {count - 1} bytes; {end - at - 1} follow.")
        data += encoded[at + 1 : at + count]
        at += count
        if count <= _LONGEST and at < end:
            data.append(0)
    return bytes(data)
