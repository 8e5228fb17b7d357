"""The inertial unit's driver against its registers: units, axes, and faults."""

import math
from typing import Any

import adafruit_icm20x
import pytest

from snr_sim.devices.device_loop import start_device
from snr_sim.devices.sensors.icm20948 import Icm20948
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError, ParameterError
from snr_sim.prelude.signals import ImuReading
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fake_icm20948 import FakeAk09916, FakeIcm20948
from tests.devices.benches import I2cBench
from tests.devices.busio_bus import BusioBus


class Bench(I2cBench):
    def __init__(self) -> None:
        self.part = FakeIcm20948()
        self.compass = FakeAk09916(self.part)
        super().__init__({0x69: self.part, 0x0C: self.compass})

    def open(self, axes: tuple[str, str, str] = ("x", "y", "z"), iron: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Icm20948:
        return Icm20948(self.bus, self.now_s, axes=axes, hard_iron_ut=iron, sleep=self.advance)

    def started(self, **how: Any) -> Icm20948:
        return start_device(self.open(**how), "the inertial unit")

    def reading(self, sensor: Icm20948) -> ImuReading:
        self.time_s += 0.01
        reading = sensor.read()
        assert isinstance(reading, ImuReading), reading
        return reading


def test_icm20948_passes_sensor_contract() -> None:
    check_sensor(Bench().open)


def test_icm20948_returns_si_units_and_microtesla() -> None:
    bench = Bench()
    sensor = bench.started()
    bench.part.rate_radps = (0.5, -1.0, 2.0)
    bench.part.force_mps2 = (1.0, -2.0, 9.0)
    bench.compass.field_ut = (15.0, -6.0, -42.0)
    reading = bench.reading(sensor)
    assert reading.rate_radps == pytest.approx([0.5, -1.0, 2.0], abs=math.radians(0.5 / 65.5))
    assert reading.specific_force_mps2 == pytest.approx([1.0, -2.0, 9.0], abs=9.81 / 8192)
    assert reading.field_ut == pytest.approx([15.0, -6.0, -42.0], abs=0.08)
    assert reading.stamp_s == bench.time_s


def test_icm20948_equals_independent_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rates and forces, in other scales than ours; it reads the magnetometer in a way that the emulated part lacks."""
    monkeypatch.setattr(adafruit_icm20x, "sleep", lambda seconds: None)
    monkeypatch.setattr(adafruit_icm20x.ICM20948, "_magnetometer_init", lambda self: True)
    bench = Bench()
    bench.part.rate_radps = (0.5, -1.0, 2.0)
    bench.part.force_mps2 = (1.0, -2.0, 9.0)
    theirs = adafruit_icm20x.ICM20948(BusioBus({0x69: bench.part}))
    forces, rates = theirs.acceleration, theirs.gyro
    ours = bench.reading(bench.started())
    assert ours.specific_force_mps2 == pytest.approx(forces, abs=9.81 / 4096)
    assert ours.rate_radps == pytest.approx(rates, abs=math.radians(1 / 65.5))


def test_icm20948_level_at_rest_returns_heading_of_field() -> None:
    bench = Bench()
    bench.compass.field_ut = (20.0, 0.0, -40.0)  # its x points north
    reading = bench.reading(bench.started())
    assert (reading.roll_rad, reading.pitch_rad) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert reading.yaw_rad == pytest.approx(math.pi / 2, abs=1e-2)


def test_icm20948_rotated_axes_return_body_frame() -> None:
    """Its y points forward, its x to the right: so the body's x is its y, and the body's y its -x."""
    bench = Bench()
    sensor = bench.started(axes=("y", "-x", "z"))
    bench.part.rate_radps = (0.1, 0.2, 0.3)
    bench.compass.field_ut = (15.0, -6.0, -42.0)
    reading = bench.reading(sensor)
    assert reading.rate_radps == pytest.approx([0.2, -0.1, 0.3], abs=1e-3)
    assert reading.field_ut == pytest.approx([-6.0, -15.0, -42.0], abs=0.08)


@pytest.mark.parametrize(
    "axes", [("x", "y", "-z"), ("x", "x", "z"), ("y", "x", "z"), ("x", "y"), ("forward", "y", "z")]
)
def test_icm20948_left_handed_axes_raise_error(axes: tuple[str, str, str]) -> None:
    with pytest.raises(ParameterError, match="are not right-handed axes"):
        Bench().open(axes)


def test_icm20948_subtracts_hard_iron() -> None:
    bench = Bench()
    bench.compass.field_ut = (30.0, 20.0, -40.0)
    reading = bench.reading(bench.started(iron=(30.0, 0.0, 0.0)))
    assert reading.field_ut == pytest.approx([0.0, 20.0, -40.0], abs=0.08)


def test_icm20948_saturated_field_keeps_last_value() -> None:
    bench = Bench()
    sensor = bench.started()
    bench.compass.field_ut, bench.compass.is_too_strong = (4000.0, 0.0, 0.0), True
    assert bench.reading(sensor).field_ut == pytest.approx([0.0, 20.0, -40.0], abs=0.08)


@pytest.mark.parametrize(
    ("who", "words"),
    [
        ("part", "0x69 on /dev/i2c-1 is not an ICM-20948: its identity is 0x71"),
        ("compass", "0x0c on .* is not its magnetometer: its identity is 0x71"),
    ],
)
def test_icm20948_wrong_identity_raises_device_error(who: str, words: str) -> None:
    bench = Bench()
    getattr(bench, who).identity = 0x71  # an MPU-9250
    with pytest.raises(DeviceError, match=words) as e:
        bench.open().configure()
    assert "AD0" in e.value.fix


def test_icm20948_without_gravity_raises_device_error() -> None:
    bench = Bench()
    bench.part.force_mps2 = (0.0, 0.0, 2.0)
    with pytest.raises(DeviceError, match=r"measures 2.0 m/s2 at the start, not 9.8"):
        bench.open().configure()


def test_icm20948_unplugged_is_stale_and_replugged_reinitialises() -> None:
    bench = Bench()
    sensor = bench.started()
    bench.reading(sensor)
    bench.raw.is_there = False
    stale = sensor.read()
    assert isinstance(stale, Stale)
    assert stale.since_s is not None
    assert "No device answers at 0x69" in stale.reason
    bench.raw.is_there = True
    bench.part.power_on()
    assert isinstance(sensor.read(), Stale)  # asleep: it would report zeros
    bench.time_s += 1.0
    for _ in range(10):
        bench.time_s += 0.05
        reading = sensor.read()
    assert isinstance(reading, ImuReading)
    assert sensor.health().counts["errors"] >= 2
