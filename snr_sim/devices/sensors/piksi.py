"""A Piksi satellite navigation receiver, which sends the Swift Binary Protocol."""

from __future__ import annotations

import math
from typing import ClassVar

from snr_sim.devices.sensors.gps_receiver import FRESH_S, GpsReceiver
from snr_sim.devices.wire.sbp_frames import SbpFrames
from snr_sim.devices.wire.sbp_messages import Dops, Heartbeat, PosLlh, VelNed, decode
from snr_sim.prelude.signals import GpsReading


class Piksi(GpsReceiver):
    """The receiver; see `GpsReceiver`.

    `altitude_m` is None with firmware that reports the height above the ellipsoid of WGS84 only.
    """

    protocol: ClassVar[str] = "SBP"
    bauds: ClassVar[str] = "a Piksi has 115200 or 1000000"

    def counts(self) -> dict[str, int]:
        """Return the counters: 'bytes', 'frames', 'damaged', and 'skipped' bytes."""
        frames = self._frames
        return {
            "bytes": self._received_bytes,
            "frames": frames.frames,
            "damaged": frames.damaged,
            "skipped": frames.skipped,
        }

    def _reset(self) -> None:
        self._frames = SbpFrames()
        self._position: PosLlh | None = None
        self._velocity: VelNed | None = None
        self._dops: Dops | None = None

    def _decode(self, data: bytes) -> None:
        for frame in self._frames.feed(data, self._now_s()):
            message = decode(frame)
            if isinstance(message, PosLlh):
                self._position, self._has_fix = message, message.has_fix
                if message.has_fix:
                    self._newest = self._reading(message, self._now_s())
            elif isinstance(message, VelNed):
                self._velocity = message
                # It follows the position of the same moment.
                if self._newest and self._position and self._position.has_fix and message.tow_s == self._position.tow_s:
                    self._newest = self._reading(self._position, self._newest.stamp_s)
            elif isinstance(message, Dops):
                self._dops = message
            elif isinstance(message, Heartbeat) and not self._is_fresh():
                self._has_fix = False  # older firmware sends no position without a fix

    def _message_count(self) -> int:
        return self._frames.frames

    def _reading(self, position: PosLlh, stamp_s: float) -> GpsReading:
        speed_mps, course_rad = _motion(self._velocity, position.tow_s)
        dops = self._dops
        has_hdop = dops is not None and 0.0 <= position.tow_s - dops.tow_s <= FRESH_S  # it comes less often
        return GpsReading(
            latitude_deg=position.latitude_deg,
            longitude_deg=position.longitude_deg,
            altitude_m=position.height_m if position.is_above_sea else None,
            speed_mps=speed_mps,
            course_rad=course_rad,
            satellites=position.satellites,
            hdop=dops.hdop if dops is not None and has_hdop else None,
            stamp_s=stamp_s,
        )


def _motion(velocity: VelNed | None, tow_s: float) -> tuple[float | None, float | None]:
    """Return speed and course of a moment; None if they are not reported, and no course at rest."""
    if velocity is None or not velocity.is_valid or velocity.tow_s != tow_s:
        return None, None
    north_mps, east_mps = velocity.north_mps, velocity.east_mps
    speed_mps = math.sqrt(north_mps * north_mps + east_mps * east_mps)
    return speed_mps, math.atan2(north_mps, east_mps) if speed_mps > 0.0 else None
