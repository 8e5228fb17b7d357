"""NMEA 0183: text lines of satellite navigation receivers, once a second. Decodes bytes to sentences.

    $GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47
     talker and type, fields between commas, the exclusive or of all between $ and * in two hexadecimal digits

Other bytes on the line are counted and skipped: a wrong baud rate, another device, half a sentence.

Source: NMEA 0183, as the receivers' makers describe it (u-blox, "Receiver Description", NMEA protocol).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from operator import xor

import msgspec

from snr_sim.devices.wire.line_splitter import LineSplitter

MAX_DIGITS = 4  # of a count
MAX_BYTES = 120  # of a line: 82 by the standard, and some receivers send more
KNOTS_TO_MPS = 1852.0 / 3600.0


class FixSentence(msgspec.Struct, frozen=True):
    """A sentence GGA: position. None where the receiver leaves a field empty."""

    time_s: float | None  # of day, UTC
    latitude_deg: float | None  # north positive
    longitude_deg: float | None  # east positive
    quality: int  # 0 none, 1 satellites, 2 with corrections, 4 and 5 with those of a base nearby
    satellites: int  # that are used
    hdop: float | None  # horizontal dilution of precision: below 2 is good
    altitude_m: float | None  # above sea level


class CourseSentence(msgspec.Struct, frozen=True):
    """A sentence RMC: speed and course. None where the receiver leaves a field empty."""

    time_s: float | None  # of day, UTC
    is_valid: bool  # whether it has a fix
    latitude_deg: float | None  # north positive
    longitude_deg: float | None  # east positive
    speed_mps: float | None  # over ground
    course_deg: float | None  # clockwise from north; left empty at rest
    date: str  # ddmmyy, as received; empty before it is known


class NmeaLines:
    """Decoder from bytes to sentences. Never raises, never grows.

    Attributes:
        sentences: complete sentences, also of types that are not decoded.
        checksum_errors: lines with a wrong check sum.
        garbage: lines that are not sentences, or too long.
    """

    def __init__(self) -> None:
        self.sentences: int = 0
        self.checksum_errors: int = 0
        self.garbage: int = 0
        self._lines = LineSplitter(MAX_BYTES)

    def feed(self, data: bytes) -> list[FixSentence | CourseSentence]:
        """Add received bytes; return the complete sentences of decoded types.

        >>> lines = NmeaLines()
        >>> len(lines.feed(b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\\r\\n"))
        1
        """
        found: list[FixSentence | CourseSentence] = []
        for line in self._lines.feed(data):
            if line is None:
                self.garbage += 1
            elif (sentence := self._sentence(line)) is not None:
                found.append(sentence)
        return found

    def _sentence(self, line: bytes) -> FixSentence | CourseSentence | None:
        if not line:
            return None
        body, star, received_checksum = line[1:].partition(b"*")
        if not line.startswith(b"$") or not star or len(received_checksum) != 2 or not line.isascii():
            self.garbage += 1
            return None
        if received_checksum.upper() != b"%02X" % checksum(body):
            self.checksum_errors += 1
            return None
        fields = body.decode("ascii").split(",")
        read = _READERS.get(fields[0][2:])
        try:
            sentence = read(fields) if read is not None else None
        except (ValueError, IndexError):
            self.garbage += 1
            return None
        self.sentences += 1
        return sentence


def checksum(body: bytes) -> int:
    """Return the check sum of the characters between $ and *.

    >>> f"{checksum(b'GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,'):02X}"
    '47'
    """
    return reduce(xor, body, 0)


def _fix(f: list[str]) -> FixSentence:
    return FixSentence(
        _time_s(f[1]), _angle_deg(f[2], f[3], "NS"), _angle_deg(f[4], f[5], "EW"), _count(f[6]), _count(f[7] or "0"),
        _number(f[8]), _number(f[9]),
    )  # fmt: skip


def _course(f: list[str]) -> CourseSentence:
    knots = _number(f[7])
    return CourseSentence(
        _time_s(f[1]), f[2] == "A", _angle_deg(f[3], f[4], "NS"), _angle_deg(f[5], f[6], "EW"),
        None if knots is None else knots * KNOTS_TO_MPS, _number(f[8]), f[9],
    )  # fmt: skip


_READERS: dict[str, Callable[[list[str]], FixSentence | CourseSentence]] = {"GGA": _fix, "RMC": _course}


def _number(text: str) -> float | None:
    if not text:
        return None
    if not set(text) <= set("0123456789.-"):  # float() would accept "nan" and "1_0"
        raise ValueError(text)
    return float(text)


def _count(text: str) -> int:
    if not (text.isdecimal() and len(text) <= MAX_DIGITS):  # a line has room for a number too large for a page
        raise ValueError(text)
    return int(text)


def _time_s(text: str) -> float | None:
    if not text:
        return None
    seconds = _number(text[4:])
    if seconds is None or not (text[:4].isdecimal() and int(text[:2]) < 24 and int(text[2:4]) < 60 and seconds < 61.0):
        raise ValueError(text)
    return int(text[:2]) * 3600 + int(text[2:4]) * 60 + seconds


def _angle_deg(text: str, side: str, sides: str) -> float | None:
    """Return the angle in degrees from ddmm.mmmm, or dddmm.mmmm, and a letter."""
    if not text:
        return None
    whole, _, part = text.partition(".")
    minutes = _number(f"{whole[-2:]}.{part or 0}")
    if minutes is None or side not in sides or not side or not whole.isdecimal() or len(whole) < 3 or minutes >= 60.0:
        raise ValueError(text)
    degrees = int(whole[:-2]) + minutes / 60.0
    if degrees > (90.0 if sides == "NS" else 180.0):
        raise ValueError(text)
    return degrees if side == sides[0] else -degrees
