"""The PCA9685's driver against its registers; and an independent driver against the same, to the count."""

from typing import Any

import pytest
from adafruit_pca9685 import PCA9685

from snr_sim.devices.device_loop import start_device
from snr_sim.devices.pwm.passive_pwm import PassivePwm
from snr_sim.devices.pwm.pca9685 import PRE_SCALE, Pca9685
from snr_sim.prelude.errors import DeviceError, ParameterError
from snr_sim.prelude.signals import LOST
from snr_sim.testing.fake_i2c import FakePca9685
from snr_sim.testing.pwm_contract import check_pwm_out
from tests.devices.benches import I2cBench
from tests.devices.busio_bus import BusioBus


class Bench(I2cBench):
    """A chip on a bus."""

    def __init__(self, channels: int = 8, part: FakePca9685 | None = None, **settings: Any) -> None:
        self.channels, self.settings = channels, settings
        self.part = part or FakePca9685()
        super().__init__({0x40: self.part})

    def open(self, is_supervised: bool = True, esc_start_s: float = 1.0, **more: Any) -> PassivePwm:
        settings = {"sleep": self.advance, **self.settings, **more}
        chip = Pca9685(self.bus, 0x40, self.channels, **settings)
        return PassivePwm(chip, self.now_s, esc_start_s, is_supervised)

    def pins_us(self) -> list[float]:
        return self.part.pins_us(self.channels)


@pytest.mark.parametrize("channels", [1, 8, 9, 16])
def test_pca9685_passes_pwm_contract(channels: int) -> None:
    check_pwm_out(Bench(channels))


@pytest.mark.parametrize(("oscillator_hz", "external"), [(26_200_000.0, False), (24_576_000.0, True)])
def test_pca9685_with_other_clocks_passes_pwm_contract(oscillator_hz: float, external: bool) -> None:
    check_pwm_out(Bench(2, FakePca9685(oscillator_hz), oscillator_hz=oscillator_hz, has_external_clock=external))


@pytest.mark.parametrize("pulse_us", [1100.0, 1234.0, 1500.0, 1500.7, 1899.0, 1900.0])
def test_pca9685_registers_equal_independent_driver(pulse_us: float) -> None:
    ours = Bench()
    out = start_device(ours.open(esc_start_s=0.0), "the outputs")
    out.write_us([1500.0] * 8, 0.0)
    made_us = out.write_us([pulse_us] * 8, 0.0).pulses_us[0]
    part = FakePca9685()
    theirs = PCA9685(BusioBus({0x40: part}))  # type: ignore[arg-type]
    theirs.frequency = 50
    assert isinstance(out.chip, Pca9685)
    for channel in range(8):
        theirs.channels[channel].duty_cycle = out.chip.count_of(pulse_us) << 4
    assert ours.part.registers[PRE_SCALE] == part.registers[PRE_SCALE] == 121
    assert ours.part.registers[0x06:0x26] == part.registers[0x06:0x26]
    assert part.pins_us(1) == [pytest.approx(made_us, abs=1e-6)]


def test_pca9685_returns_generated_pulses_in_whole_counts() -> None:
    bench = Bench()
    out = start_device(bench.open(esc_start_s=0.0), "the outputs")
    assert out.write_us([1500.0] * 8, 0.0).pulses_us == bench.pins_us()
    assert bench.pins_us() == [pytest.approx(1498.2, abs=0.05)] * 8
    made = out.write_us([1100.0, 1900.0, *[1500.0] * 6], 0.0).pulses_us
    assert made == bench.pins_us()
    assert made[:2] == [pytest.approx(1102.9, abs=0.05), pytest.approx(1898.3, abs=0.05)]  # 225 counts were too short


def test_pca9685_unmeasured_oscillator_shifts_pulses() -> None:
    bench = Bench(part=FakePca9685(oscillator_hz=27_000_000.0))
    out = bench.open(esc_start_s=0.0)
    out.configure()
    assert bench.pins_us()[0] == pytest.approx(1498.2 * 25 / 27, abs=0.1)  # 1387 us: astern
    out.close()
    measured = bench.open(oscillator_hz=27_000_000.0)
    measured.configure()
    assert bench.pins_us()[0] == pytest.approx(1500.0, abs=2.5)


def test_pca9685_configure_stops_running_pulses_first() -> None:
    bench = Bench()
    before = start_device(bench.open(esc_start_s=0.0), "the outputs")
    before.write_us([1500.0] * 8, 0.0)
    before.write_us([1900.0] * 8, 0.0)
    writes: list[list[float]] = []
    bench.open(sleep=lambda seconds: writes.append(bench.pins_us())).configure()
    assert writes == [[0.0] * 8]
    assert bench.pins_us() == [pytest.approx(1498.2, abs=0.05)] * 8


def test_pca9685_without_supervisor_stays_neutral() -> None:
    bench = Bench()
    out = bench.open(is_supervised=False)
    assert not out.has_independent_failsafe
    out.configure()
    with pytest.raises(DeviceError, match=r"keeps its last pulse if this program is killed") as e:
        out.activate()
    assert "behind the supervisor" in e.value.fix
    out.write_us([1900.0] * 8, 0.0)
    assert bench.pins_us() == [pytest.approx(1498.2, abs=0.05)] * 8


def test_pca9685_brown_out_is_reported_as_lost() -> None:
    bench = Bench()
    out = start_device(bench.open(esc_start_s=0.0), "the outputs")
    out.write_us([1500.0] * 8, 0.0)
    bench.part.power_on()
    applied = out.write_us([1700.0] * 8, 0.0)
    assert LOST in applied.reason
    assert "it was reset, so it makes no pulses" in out.health().reason


def test_pca9685_other_part_at_address_raises_device_error() -> None:
    class PowerMonitor:
        def write(self, register: int, data: list[int]) -> None:
            pass

        def read(self, register: int, length: int) -> list[int]:
            return [0x39] * length

    bench = Bench()
    bench.raw.parts = {0x40: PowerMonitor()}
    with pytest.raises(
        DeviceError, match=r"at 0x40 on /dev/i2c-1 is not a PCA9685: MODE1 was written 0x20 and reads"
    ) as e:
        bench.open().configure()
    assert "INA219" in e.value.fix


def test_pca9685_stuck_on_external_clock_raises_device_error() -> None:
    bench = Bench(has_external_clock=True)
    bench.open().configure()
    with pytest.raises(DeviceError, match="still uses the clock at its EXTCLK pin"):
        bench.open(has_external_clock=False).configure()


def test_pca9685_missing_chip_lists_devices_on_bus() -> None:
    bench = Bench()
    bench.raw.parts = {0x41: bench.part}
    with pytest.raises(DeviceError, match="No device answers at 0x40 on /dev/i2c-1; devices on that bus: 0x41"):
        bench.open().configure()


def test_pca9685_too_many_channels_or_invalid_clock_raises_error() -> None:
    with pytest.raises(ParameterError, match="1 to 16"):
        Bench(17).open()
    with pytest.raises(ParameterError, match="cannot make 50 Hz"):
        Bench().open(oscillator_hz=1e9)
