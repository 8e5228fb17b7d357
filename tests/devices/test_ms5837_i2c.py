"""The real sensor's driver against the part of the data sheet, in simulated time."""

import pytest

from snr_sim.devices.device_loop import start_device
from snr_sim.devices.sensors.ms5837 import Ms5837
from snr_sim.devices.sensors.ms5837_i2c import Ms5837I2c
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.signals import DepthReading
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fake_ms5837 import FakeMs5837
from tests.devices.benches import I2cBench


class Bench(I2cBench):
    def __init__(self) -> None:
        self.part = FakeMs5837(self.now_s)
        super().__init__({0x76: self.part})
        self.slept_s = 0.0

    def sleep(self, seconds: float) -> None:
        self.advance(seconds)
        self.slept_s += seconds

    def open(self, part: Ms5837 | None = None) -> Ms5837I2c:
        return Ms5837I2c(self.bus, self.now_s, part, sleep=self.sleep)

    def started(self, part: Ms5837 | None = None) -> Ms5837I2c:
        return start_device(self.open(part), "the depth sensor")

    def reading(self, sensor: Ms5837I2c, ticks: int = 3, period_s: float = 0.05) -> DepthReading | Stale:
        reading = sensor.read()
        for _ in range(ticks):
            self.time_s += period_s
            reading = sensor.read()
        return reading


def test_ms5837_i2c_passes_sensor_contract() -> None:
    check_sensor(Bench().open)


def test_ms5837_i2c_depth_is_relative_to_pressure_at_start() -> None:
    bench = Bench()
    bench.part.set_environment(99_000.0, 15.0)  # low air pressure, and the sensor's offset
    sensor = bench.started()
    bench.part.set_environment(99_000.0 + 1000.0 * 9.81 * 2.5, 12.0)
    reading = bench.reading(sensor, ticks=12)
    assert isinstance(reading, DepthReading)
    assert reading.depth_m == pytest.approx(2.5, abs=0.002)
    assert reading.temperature_c == pytest.approx(12.0, abs=0.01)
    assert bench.time_s - reading.stamp_s < 0.1


def test_ms5837_i2c_started_under_water_keeps_default_surface() -> None:
    bench = Bench()
    bench.part.set_environment(101_325.0 + 20_000.0, 15.0)
    reading = bench.reading(bench.started())
    assert isinstance(reading, DepthReading)
    assert reading.depth_m == pytest.approx(20_000.0 / (1000.0 * 9.81), abs=0.01)


def test_ms5837_i2c_reconnected_under_water_keeps_its_surface() -> None:
    bench = Bench()
    bench.part.set_environment(100_000.0, 15.0)
    sensor = bench.started()
    bench.part.set_environment(104_000.0, 15.0)
    sensor.fail("for a test")
    sensor.configure()
    sensor.activate()
    reading = bench.reading(sensor)
    assert isinstance(reading, DepthReading)
    assert reading.depth_m == pytest.approx(0.408, abs=0.002)


def test_ms5837_i2c_read_never_waits_and_is_fresh_at_20_hz() -> None:
    bench = Bench()
    sensor = bench.started()
    slept_s = bench.slept_s
    stamps = set()
    for _ in range(100):
        bench.time_s += 0.05
        reading = sensor.read()
        assert isinstance(reading, DepthReading)
        stamps.add(reading.stamp_s)
    assert bench.slept_s == slept_s
    assert 89 <= len(stamps) <= 91  # in one of ten ticks the temperature was measured


def test_ms5837_i2c_read_during_conversion_returns_last_reading() -> None:
    bench = Bench()
    sensor = bench.started()
    readings = []
    for _ in range(1000):
        bench.time_s += 0.002
        readings.append(sensor.read())
    assert not [one for one in readings if isinstance(one, Stale)]
    assert 70 <= len({one.stamp_s for one in readings if isinstance(one, DepthReading)}) <= 100  # in two seconds


def test_ms5837_i2c_unplugged_is_stale_and_replugged_recovers() -> None:
    bench = Bench()
    sensor = bench.started()
    good = bench.reading(sensor)
    bench.raw.is_there = False
    stale = bench.reading(sensor, ticks=20)
    assert isinstance(stale, Stale)
    assert isinstance(good, DepthReading)
    assert "No device answers at 0x76 on /dev/i2c-1" in stale.reason
    assert stale.since_s is not None
    assert sensor.health().counts["errors"] > 3
    bench.raw.is_there = True
    bench.part.power_on()
    assert isinstance(bench.reading(sensor), DepthReading)


def test_ms5837_i2c_wrong_calibration_checksum_raises_device_error() -> None:
    bench = Bench()
    bench.part.words[3] ^= 0x0010
    with pytest.raises(
        DeviceError, match=r"MS5837 at 0x76 on /dev/i2c-1: its calibration has the checksum 2, but 1"
    ) as e:
        bench.open().configure()
    assert "shorter wires" in e.value.fix


def test_ms5837_i2c_zero_calibration_raises_device_error() -> None:
    bench = Bench()
    bench.part.words = [0] * 7  # its check sum is right
    with pytest.raises(DeviceError, match="0000 0000 0000"):
        bench.open().configure()


def test_ms5837_i2c_implausible_pressure_is_stale() -> None:
    bench = Bench()
    sensor = bench.started()
    bench.part.d1 = 2**24 - 1
    stale = bench.reading(sensor, ticks=20)
    assert isinstance(stale, Stale)
    assert "Pa, outside its range of" in stale.reason
