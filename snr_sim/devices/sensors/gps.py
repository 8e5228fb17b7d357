"""A satellite navigation receiver on a serial port. At the surface only: water blocks the signals."""

from __future__ import annotations

import math
from collections.abc import Callable

from snr_sim.devices.wire.nmea import CourseSentence, FixSentence, NmeaLines
from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.devices.wire.wire_handle import WireHandle
from snr_sim.prelude.angles import wrap_rad
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.life_cycle import LifeCycleSensor
from snr_sim.prelude.signals import GpsReading

BAUD = 9600
FRESH_S = 2.5  # most receivers report once a second
RETRY_PERIOD_S = 1.0
_SHOWN = 16


class Gps(LifeCycleSensor):
    """The receiver. Implements `Sensor`; reads `GpsReading`, and is stale without a fix.

    `now_s` is the clock that stamps readings on arrival.
    """

    def __init__(self, open_port: Callable[[], BytePort], now_s: Callable[[], float]) -> None:
        self.title: str = "The receiver"
        self._now_s = now_s
        self._port = WireHandle(open_port, self)
        self._lines = NmeaLines()
        self._course: CourseSentence | None = None
        self._newest: GpsReading | None = None
        self._received_bytes = 0
        self._last = b""
        self._quality: int | None = None
        self._retry_s = 0.0

    def counts(self) -> dict[str, int]:
        """Return the counters: 'bytes', 'sentences', 'checksum_errors', 'garbage'."""
        lines = self._lines
        return {
            "bytes": self._received_bytes,
            "sentences": lines.sentences,
            "checksum_errors": lines.checksum_errors,
            "garbage": lines.garbage,
        }

    def on_configure(self) -> None:
        """Open the port. A missing receiver is detected only when sentences stay out."""
        self.title = f"The receiver on {self._port.open().name}"
        self._lines, self._received_bytes, self._last, self._quality = NmeaLines(), 0, b"", None

    def read(self) -> GpsReading | Stale:
        """Return the newest fix; raise a SensorLostError if it was closed."""
        try:
            if self.state == "error" and self._now_s() >= self._retry_s:
                self._retry_s = self._now_s() + RETRY_PERIOD_S
                self.configure()
                self.activate()
            if self.state == "active":
                self._receive()
        except DeviceError as error:
            self.fail(error.message)
        newest = self._newest
        since_s = newest.stamp_s if newest else None
        idle = self.idle(since_s)
        if idle is not None:
            return idle
        if newest is not None and self._now_s() <= newest.stamp_s + FRESH_S:
            return newest
        return Stale(self._stale_reason(), since_s)

    def on_close(self) -> None:
        """Close the port."""
        self._port.close()

    def _receive(self) -> None:
        data = self._port.get().read()
        self._received_bytes += len(data)
        self._last = (self._last + data)[-_SHOWN:]
        for sentence in self._lines.feed(data):
            if isinstance(sentence, CourseSentence):
                self._course = sentence
            else:
                self._take(sentence)

    def _take(self, fix: FixSentence) -> None:
        self._quality = fix.quality
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

    def _stale_reason(self) -> str:
        lines = self._lines
        if self._received_bytes == 0:
            return f"{self.title} sends nothing: 0 bytes. Is its TX at our RX, and does it have power?"
        if lines.sentences == 0:
            return (
                f"{self.title} sent {self._received_bytes} bytes that are not NMEA, such as {self._last.hex(' ')}: "
                "another baud rate (receivers have 9600 or 38400), or another device."
            )
        if self._quality == 0:
            return f"{self.title} has no fix: it needs the open sky, for a minute when it is cold."
        return f"{self.title} has stopped telling where it is."


def _course_rad(course_deg: float | None) -> float | None:
    """Return a course, clockwise from north, as yaw: from east, positive to the left."""
    return None if course_deg is None else wrap_rad(math.radians(90.0 - course_deg))
