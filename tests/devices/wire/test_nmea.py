"""Sentences against an independent reader, and other bytes on the line."""

import random

import pynmea2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.wire.nmea import KNOTS_TO_MPS, MAX_BYTES, CourseSentence, FixSentence, NmeaLines, checksum

GGA = "GPGGA,123519.25,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"
SENTENCES = [
    GGA,
    "GNGGA,000000.00,3351.5,S,15112.6,W,4,31,0.45,-3.2,M,20.0,M,1.0,0000",
    "GPGGA,,,,,,0,00,99.99,,,,,,",
    "GPRMC,123519.25,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W",
    "GNRMC,081836.75,A,3751.65,S,14507.36,E,000.0,,130998,,,A",
    "GPRMC,,V,,,,,,,,,,N",
]


def line(body: str) -> bytes:
    return f"${body}*{checksum(body.encode()):02X}\r\n".encode()


@pytest.mark.parametrize("body", SENTENCES)
def test_nmea_lines_equal_independent_reader(body: str) -> None:
    (ours,) = NmeaLines().feed(line(body))
    theirs = pynmea2.parse(line(body).decode().strip(), check=True)
    has_place = bool(theirs.lat)
    assert ours.latitude_deg == (pytest.approx(theirs.latitude) if has_place else None)
    assert ours.longitude_deg == (pytest.approx(theirs.longitude) if has_place else None)
    time = theirs.timestamp
    at_s = time and time.hour * 3600 + time.minute * 60 + time.second + time.microsecond * 1e-6
    assert ours.time_s == (pytest.approx(at_s) if time else None)
    if isinstance(ours, FixSentence):
        assert (ours.quality, ours.satellites) == (theirs.gps_qual, int(theirs.num_sats))
        assert ours.altitude_m == theirs.altitude
        assert ours.hdop == float(theirs.horizontal_dil)
    else:
        assert isinstance(ours, CourseSentence)
        assert ours.is_valid == (theirs.status == "A")
        knots = theirs.spd_over_grnd
        assert ours.speed_mps == (None if knots is None else pytest.approx(knots * 1852 / 3600))
        assert ours.course_deg == theirs.true_course


def test_nmea_knots_convert_to_metres_per_second() -> None:
    assert pytest.approx(0.514444, abs=1e-6) == KNOTS_TO_MPS


def test_nmea_sentences_are_found_in_any_chunks_and_noise() -> None:
    chance = random.Random(1)
    data = b"\xff\x00half,of,one*12\r\n" + b"".join(map(line, SENTENCES)) + b"\r\n"
    lines = NmeaLines()
    found = []
    while data:
        n = chance.randint(1, 9)
        found += lines.feed(data[:n])
        data = data[n:]
    assert len(found) == len(SENTENCES)
    assert (lines.sentences, lines.garbage, lines.checksum_errors) == (len(SENTENCES), 1, 0)


def test_nmea_single_flipped_bit_is_detected() -> None:
    good = line(GGA)
    for i in range(len(good) - 2):
        for bit in range(8):
            bad = bytearray(good)
            bad[i] ^= 1 << bit
            lines = NmeaLines()
            assert lines.feed(bytes(bad) + b"\n") in ([], NmeaLines().feed(good)), (
                bad
            )  # a letter's case in the check sum


@pytest.mark.parametrize(
    "body",
    [
        "GPGGA,123519,4867.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",  # 67 minutes
        "GPGGA,123519,9107.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",
        "GPGGA,253519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",
        "GPGGA,123519,4807.038,X,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",
        "GPGGA,123519,4807.038,N,01131.000,E,1,08,nan,545.4,M,46.9,M,,",
        "GPGGA,123519,4807.038,N,01131.000,E,1,99999999999999999999,0.9,545.4,M,46.9,M,,",
        "GPGGA,123519,4807.038,N,01131.000,E,1,1_0,0.9,545.4,M,46.9,M,,",
        "GPGGA,123519,4807.038",
        "GPRMC",
    ],
)
def test_nmea_impossible_values_count_as_garbage(body: str) -> None:
    lines = NmeaLines()
    assert lines.feed(line(body)) == []
    assert (lines.garbage, lines.sentences) == (1, 0)


def test_nmea_other_types_count_as_sentences() -> None:
    lines = NmeaLines()
    assert lines.feed(line("GPGSV,3,1,11,03,03,111,00")) == []
    assert (lines.sentences, lines.garbage) == (1, 0)


def test_nmea_endless_line_is_dropped() -> None:
    lines = NmeaLines()
    for _ in range(1000):
        lines.feed(b"x" * 1000)
        assert len(lines._lines._rest) <= MAX_BYTES
    assert len(lines.feed(b"\n" + line(GGA))) == 1
    assert lines.garbage == 1


@given(st.lists(st.binary(max_size=200), max_size=20))
def test_nmea_any_bytes_raise_nothing(pieces: list[bytes]) -> None:
    lines = NmeaLines()
    for piece in pieces:
        lines.feed(piece)
    assert len(lines.feed(b"\n" + line(GGA))) == 1
