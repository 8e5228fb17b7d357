"""A Piksi, with bytes in place of the sky: the same readings and reasons as of a receiver with NMEA."""

import math
import struct

import pytest

from snr_sim.devices.sensors.piksi import Piksi
from snr_sim.devices.wire.sbp_frames import SbpFrame, encode
from snr_sim.prelude.signals import GpsReading
from snr_sim.testing.contracts import check_sensor
from tests.devices.benches import SerialReceiver, stale

HEARTBEAT = encode(SbpFrame(0xFFFF, bytes(4)))


def position(tow_ms: int = 1000, kind: int = 0x020A, flags: int = 1) -> bytes:
    return encode(SbpFrame(kind, struct.pack("<IdddHHBB", tow_ms, 52.1, -106.6, 482.0, 0, 0, 9, flags)))


def velocity(tow_ms: int = 1000, north_mmps: int = 1000, east_mmps: int = -1000, flags: int = 1) -> bytes:
    return encode(SbpFrame(0x020E, struct.pack("<IiiiHHBB", tow_ms, north_mmps, east_mmps, 0, 0, 0, 9, flags)))


def precision(tow_ms: int = 1000) -> bytes:
    return encode(SbpFrame(0x0208, struct.pack("<IHHHHHB", tow_ms, 1, 2, 3, 125, 5, 1)))


def read(data: bytes) -> GpsReading:
    receiver = SerialReceiver()
    receiver.pending = data
    reading = receiver.started(Piksi).read()
    assert isinstance(reading, GpsReading)
    return reading


def test_piksi_passes_sensor_contract() -> None:
    def opened() -> Piksi:
        receiver = SerialReceiver()
        receiver.pending = position()
        return Piksi(receiver.open, receiver.now_s)

    check_sensor(opened)


@pytest.mark.parametrize("data", [position() + velocity() + precision(), precision() + velocity() + position()])
def test_piksi_joins_messages_of_same_time(data: bytes) -> None:
    reading = read(precision(0) + data)
    assert (reading.latitude_deg, reading.longitude_deg, reading.satellites) == (52.1, -106.6, 9)
    assert reading.speed_mps == pytest.approx(math.sqrt(2.0))
    assert reading.course_rad == pytest.approx(0.75 * math.pi)  # to the north-west: as yaw, from east to the left
    assert reading.hdop == 1.25
    assert reading.altitude_m is None  # the height is above the ellipsoid


def test_piksi_velocity_of_other_time_or_invalid_is_left_out() -> None:
    for data in (velocity(900) + position(1000), position(1000) + velocity(1100), position() + velocity(flags=0)):
        reading = read(data)
        assert (reading.speed_mps, reading.course_rad) == (None, None)


def test_piksi_at_rest_has_no_course() -> None:
    reading = read(position() + velocity(north_mmps=0, east_mmps=0))
    assert (reading.speed_mps, reading.course_rad) == (0.0, None)


def test_piksi_old_or_later_precision_is_left_out() -> None:
    assert read(precision(1000) + position(3500)).hdop == 1.25
    assert read(precision(1000) + position(3501)).hdop is None
    assert read(precision(1001) + position(1000)).hdop is None


def test_piksi_older_firmware_reports_height_above_sea() -> None:
    assert read(position(kind=0x0201, flags=0x08)).altitude_m == 482.0
    assert read(position(kind=0x0201, flags=0x00)).altitude_m is None


def test_piksi_velocity_keeps_stamp_of_position() -> None:
    receiver = SerialReceiver()
    piksi = receiver.started(Piksi)
    receiver.pending = position()
    piksi.read()
    receiver.advance(0.02)
    receiver.pending = velocity()
    reading = piksi.read()
    assert isinstance(reading, GpsReading)
    assert (reading.stamp_s, reading.speed_mps is None) == (0.0, False)


@pytest.mark.parametrize("no_fix", [position(flags=0), HEARTBEAT])
def test_piksi_without_fix_is_stale_and_never_at_0(no_fix: bytes) -> None:
    receiver = SerialReceiver()
    piksi = receiver.started(Piksi)
    receiver.pending = no_fix
    assert "has no fix: it needs the open sky" in stale(piksi.read())
    receiver.pending = position()
    assert isinstance(piksi.read(), GpsReading)
    receiver.pending = no_fix
    assert isinstance(piksi.read(), GpsReading)  # the newest is fresh
    receiver.advance(3.0)
    receiver.pending = no_fix
    assert "has no fix" in stale(piksi.read())


def test_piksi_stale_reason_names_the_cause() -> None:
    receiver = SerialReceiver()
    piksi = receiver.started(Piksi)
    assert "/dev/ttyS0 sends nothing: 0 bytes." in stale(piksi.read())
    receiver.pending = b"$GPGGA,1"
    reason = stale(piksi.read())
    assert "sent 8 bytes that are not SBP, such as 24 47 50 47 47 41 2c 31" in reason
    assert "a Piksi has 115200 or 1000000" in reason
    receiver.pending = position()
    piksi.read()
    receiver.advance(3.0)
    assert "has stopped telling where it is" in stale(piksi.read())
    assert piksi.health().counts == {"bytes": 8 + len(position()), "frames": 1, "damaged": 0, "skipped": 8}


def test_piksi_pulled_cable_is_stale_and_recovers() -> None:
    receiver = SerialReceiver()
    piksi = receiver.started(Piksi)
    receiver.pending = position()
    piksi.read()
    receiver.is_plugged = False
    assert "/dev/ttyS0 is gone" in stale(piksi.read())
    receiver.is_plugged = True
    receiver.advance(5.0)
    receiver.pending = position()
    assert isinstance(piksi.read(), GpsReading)
