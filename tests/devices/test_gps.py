"""The receiver, with a text in place of the sky."""

import math

import pytest

from snr_sim.devices.sensors.gps import Gps
from snr_sim.devices.wire.nmea import checksum
from snr_sim.prelude.signals import GpsReading
from snr_sim.testing.contracts import check_sensor
from tests.devices.benches import SerialReceiver, stale

GGA = "GPGGA,{time},4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"
RMC = "GPRMC,{time},A,4807.038,N,01131.000,E,010.0,090.0,230394,003.1,W"


def line(body: str, time: str = "123519") -> bytes:
    body = body.format(time=time)
    return f"${body}*{checksum(body.encode()):02X}\r\n".encode()


def test_gps_passes_sensor_contract() -> None:
    def opened() -> Gps:
        receiver = SerialReceiver()
        receiver.pending = line(GGA)
        return Gps(receiver.open, receiver.now_s)

    check_sensor(opened)


def test_gps_joins_position_and_course_of_same_time() -> None:
    receiver = SerialReceiver()
    gps = receiver.started(Gps)
    receiver.pending = line(RMC) + line(GGA)
    reading = gps.read()
    assert isinstance(reading, GpsReading)
    assert reading.latitude_deg == pytest.approx(48 + 7.038 / 60)
    assert reading.longitude_deg == pytest.approx(11.5166667)
    assert reading.speed_mps == pytest.approx(5.14444, abs=1e-4)
    assert reading.course_rad == pytest.approx(0.0)  # 090 is east
    receiver.pending = line(GGA, "123520")
    later = gps.read()
    assert isinstance(later, GpsReading)
    assert later.speed_mps is None  # it was reported a moment before


def test_gps_course_north_equals_yaw_of_quarter_turn() -> None:
    receiver = SerialReceiver()
    gps = receiver.started(Gps)
    receiver.pending = line(RMC.replace("090.0", "000.0")) + line(GGA)
    reading = gps.read()
    assert isinstance(reading, GpsReading)
    assert reading.course_rad == pytest.approx(math.pi / 2)


def test_gps_stale_reason_names_the_cause() -> None:
    receiver = SerialReceiver()
    gps = receiver.started(Gps)
    assert "/dev/ttyS0 sends nothing: 0 bytes. Is its TX at our RX" in stale(gps.read())
    receiver.pending = b"\x00\xe6\x98\xf8" * 8
    reason = stale(gps.read())
    assert "sent 32 bytes that are not NMEA, such as 00 e6 98 f8" in reason
    assert "another baud rate" in reason
    receiver.pending = b"\n" + line("GPGGA,{time},,,,,0,00,99.99,,,,,,")
    assert "has no fix: it needs the open sky" in stale(gps.read())
    receiver.pending = line(GGA)
    assert isinstance(gps.read(), GpsReading)
    receiver.time_s = 3.0
    assert "has stopped telling where it is" in stale(gps.read())
    assert gps.health().counts["garbage"] == 1


def test_gps_pulled_cable_is_stale_and_recovers() -> None:
    receiver = SerialReceiver()
    gps = receiver.started(Gps)
    receiver.pending = line(GGA)
    gps.read()
    receiver.is_plugged = False
    assert "/dev/ttyS0 is gone" in stale(gps.read())
    assert gps.health().state == "error"
    receiver.is_plugged = True
    receiver.time_s = 5.0
    receiver.pending = line(GGA)
    assert isinstance(gps.read(), GpsReading)
