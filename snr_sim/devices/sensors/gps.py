"""A satellite navigation receiver that sends NMEA 0183."""

from __future__ import annotations

import math
from typing import ClassVar

from snr_sim.devices.sensors.gps_receiver import GpsReceiver
from snr_sim.devices.wire.nmea import CourseSentence, FixSentence, NmeaLines
from snr_sim.prelude.angles import wrap_rad
from snr_sim.prelude.signals import GpsReading

BAUD = 9600


class Gps(GpsReceiver):
    """The receiver; see `GpsReceiver`."""

    protocol: ClassVar[str] = "NMEA"
    bauds: ClassVar[str] = "receivers have 9600 or 38400"
    _course: CourseSentence | None = None

    def counts(self) -> dict[str, int]:
        """Return the counters: 'bytes', 'sentences', 'checksum_errors', 'garbage'."""
        lines = self._lines
        return {
            "bytes": self._received_bytes,
            "sentences": lines.sentences,
            "checksum_errors": lines.checksum_errors,
            "garbage": lines.garbage,
        }

    def _reset(self) -> None:
        self._lines = NmeaLines()

    def _decode(self, data: bytes) -> None:
        for sentence in self._lines.feed(data):
            if isinstance(sentence, CourseSentence):
                self._course = sentence
            else:
                self._take(sentence)

    def _message_count(self) -> int:
        return self._lines.sentences

    def _take(self, fix: FixSentence) -> None:
        self._has_fix = fix.quality != 0
        if fix.quality == 0 or fix.latitude_deg is None or fix.longitude_deg is None:
            return
        course = self._course
        is_same_time = course is not None and course.is_valid and course.time_s == fix.time_s
        self._newest = GpsReading(
            latitude_deg=fix.latitude_deg,
            longitude_deg=fix.longitude_deg,
            altitude_m=fix.altitude_m,
            speed_mps=course.speed_mps if course is not None and is_same_time else None,
            course_rad=_course_rad(course.course_deg) if course is not None and is_same_time else None,
            satellites=fix.satellites,
            hdop=fix.hdop,
            stamp_s=self._now_s(),
        )


def _course_rad(course_deg: float | None) -> float | None:
    """Return a course, clockwise from north, as yaw: from east, positive to the left."""
    return None if course_deg is None else wrap_rad(math.radians(90.0 - course_deg))
