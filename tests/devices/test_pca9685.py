"""The PCA9685's driver against its registers; and an independent driver against the same, to the count."""

from typing import Any

import pytest
from adafruit_pca9685 import PCA9685

from snr_sim.devices.pwm.pca9685 import PRE_SCALE, Pca9685
from snr_sim.devices.pwm.plain_pwm import PlainPwm
from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.prelude.errors import DeviceError, ParameterError
from snr_sim.prelude.signals import LOST
from snr_sim.testing.busio_bus import BusioBus
from snr_sim.testing.i2c_parts import FakeBus, Pca9685Part
from snr_sim.testing.pwm_contract import check_pwm_out


class Bench:
    """A chip on a bus."""

    can_unplug = True

    def __init__(self, channels: int = 8, part: Pca9685Part | None = None, **settings: Any) -> None:
        self.time_s = 0.0
        self.channels, self.settings = channels, settings
        self.part = part or Pca9685Part()
        self.raw = FakeBus({0x40: self.part})

    def open(self, is_supervised: bool = True, esc_start_s: float = 1.0, **more: Any) -> PlainPwm:
        settings = {"sleep": self.advance, **self.settings, **more}
        chip = Pca9685(lambda: I2cBus(1, self.raw.opened), 0x40, self.channels, **settings)
        return PlainPwm(chip, self.now_s, esc_start_s, is_supervised)

    def now_s(self) -> float:
        return self.time_s

    def advance(self, seconds: float) -> None:
        self.time_s += seconds

    def pins_us(self) -> list[float]:
        return self.part.pins_us(self.channels)

    def unplug(self) -> None:
        self.raw.is_there = False

    def plug_in(self) -> None:
        self.raw.is_there = True


@pytest.mark.parametrize("channels", [1, 8, 9, 16])
def test_it_keeps_the_promise_of_outputs(channels: int) -> None:
    check_pwm_out(Bench(channels))


@pytest.mark.parametrize(("oscillator_hz", "external"), [(26_200_000.0, False), (24_576_000.0, True)])
def test_it_keeps_it_with_a_measured_oscillator_and_with_a_clock_outside(oscillator_hz: float, external: bool) -> None:
    check_pwm_out(Bench(2, Pca9685Part(oscillator_hz), oscillator_hz=oscillator_hz, has_external_clock=external))


@pytest.mark.parametrize("pulse_us", [1100.0, 1234.0, 1500.0, 1500.7, 1899.0, 1900.0])
def test_an_independent_driver_sets_the_same_registers_for_the_same_pulse(pulse_us: float) -> None:
    ours = Bench()
    out = ours.open(esc_start_s=0.0)
    out.configure()
    out.activate()
    out.write_us([1500.0] * 8, 0.0)
    made_us = out.write_us([pulse_us] * 8, 0.0).pulses_us[0]
    part = Pca9685Part()
    theirs = PCA9685(BusioBus({0x40: part}))  # type: ignore[arg-type]
    theirs.frequency = 50
    assert isinstance(out.chip, Pca9685)
    for channel in range(8):
        theirs.channels[channel].duty_cycle = out.chip.count_of(pulse_us) << 4
    assert ours.part.registers[PRE_SCALE] == part.registers[PRE_SCALE] == 121
    assert ours.part.registers[0x06:0x26] == part.registers[0x06:0x26]
    assert part.pins_us(1) == [pytest.approx(made_us, abs=1e-6)]


def test_what_is_told_is_what_is_made_in_whole_counts() -> None:
    bench = Bench()
    out = bench.open(esc_start_s=0.0)
    out.configure()
    out.activate()
    assert out.write_us([1500.0] * 8, 0.0).pulses_us == bench.pins_us()
    assert bench.pins_us() == [pytest.approx(1498.2, abs=0.05)] * 8
    made = out.write_us([1100.0, 1900.0, *[1500.0] * 6], 0.0).pulses_us
    assert made == bench.pins_us()
    assert made[:2] == [pytest.approx(1102.9, abs=0.05), pytest.approx(1898.3, abs=0.05)]  # 225 counts were too short


def test_an_oscillator_that_was_not_measured_makes_other_pulses_than_told() -> None:
    bench = Bench(part=Pca9685Part(oscillator_hz=27_000_000.0))
    out = bench.open(esc_start_s=0.0)
    out.configure()
    assert bench.pins_us()[0] == pytest.approx(1498.2 * 25 / 27, abs=0.1)  # 1387 us: astern
    out.close()
    measured = bench.open(oscillator_hz=27_000_000.0)
    measured.configure()
    assert bench.pins_us()[0] == pytest.approx(1500.0, abs=2.5)


def test_a_chip_that_was_pushing_when_this_program_comes_is_stopped_first() -> None:
    bench = Bench()
    before = bench.open(esc_start_s=0.0)
    before.configure()
    before.activate()
    before.write_us([1500.0] * 8, 0.0)
    before.write_us([1900.0] * 8, 0.0)
    writes: list[list[float]] = []
    bench.open(sleep=lambda seconds: writes.append(bench.pins_us())).configure()
    assert writes == [[0.0] * 8]
    assert bench.pins_us() == [pytest.approx(1498.2, abs=0.05)] * 8


def test_without_the_supervisor_it_is_not_armed_and_stays_neutral() -> None:
    bench = Bench()
    out = bench.open(is_supervised=False)
    assert not out.fails_safe_alone
    out.configure()
    with pytest.raises(DeviceError, match=r"keeps its last pulse for ever if this program is killed") as e:
        out.activate()
    assert "behind the supervisor" in e.value.fix
    out.write_us([1900.0] * 8, 0.0)
    assert bench.pins_us() == [pytest.approx(1498.2, abs=0.05)] * 8


def test_a_brown_out_that_put_it_to_sleep_is_lost_and_told() -> None:
    bench = Bench()
    out = bench.open(esc_start_s=0.0)
    out.configure()
    out.activate()
    out.write_us([1500.0] * 8, 0.0)
    bench.part.power_on()
    applied = out.write_us([1700.0] * 8, 0.0)
    assert LOST in applied.why
    assert "it was reset, so it makes no pulses" in out.health().why


def test_another_part_at_its_address_is_told() -> None:
    class PowerMonitor:
        def write(self, register: int, data: list[int]) -> None:
            pass

        def read(self, register: int, length: int) -> list[int]:
            return [0x39] * length

    bench = Bench()
    bench.raw.parts = {0x40: PowerMonitor()}
    with pytest.raises(
        DeviceError, match=r"at 0x40 on /dev/i2c-1 is no PCA9685: MODE1 was written 0x20 and shows"
    ) as e:
        bench.open().configure()
    assert "INA219" in e.value.fix


def test_a_chip_that_keeps_to_the_clock_outside_is_told_to_be_switched_off() -> None:
    bench = Bench(has_external_clock=True)
    bench.open().configure()
    with pytest.raises(DeviceError, match="still goes by a clock at its EXTCLK pin"):
        bench.open(has_external_clock=False).configure()


def test_a_missing_chip_is_told_with_who_is_there() -> None:
    bench = Bench()
    bench.raw.parts = {0x41: bench.part}
    with pytest.raises(DeviceError, match="Nobody answers at 0x40 on /dev/i2c-1; on that bus there is: 0x41"):
        bench.open().configure()


def test_more_channels_than_there_are_and_an_impossible_clock_are_refused() -> None:
    with pytest.raises(ParameterError, match="1 to 16"):
        Bench(17).open()
    with pytest.raises(ParameterError, match="no 50 Hz"):
        Bench().open(oscillator_hz=1e9)
