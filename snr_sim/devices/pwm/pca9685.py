"""A PCA9685: sixteen servo pulses from a chip on I2C, in 4096 steps of a period.

Its steps are 4.88 us at 50 Hz, so 1500 us become 1498.2: it reports the pulses that are generated. The length of a step
depends on its oscillator, which may be 8 % off: measure a pulse of 1500 us once and pass `oscillator_hz`, or clock it
externally. It holds its last pulses indefinitely when this program is killed or the wire is pulled: so it can be armed
only behind the supervisor, and for real water connect its OE pin to a circuit that disables the outputs by itself.

Source of registers and sequences: NXP, PCA9685 product data sheet, section 7.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from snr_sim.devices.pwm.passive_pwm import PwmChip
from snr_sim.devices.pwm.pwm_backend import LIMITS_US, STOP_US
from snr_sim.devices.wire.i2c_bus import MAX_BYTES, I2cBus
from snr_sim.devices.wire.wire_handle import WireHandle
from snr_sim.prelude.errors import DeviceError, ParameterError

COUNTS = 4096
OSCILLATOR_HZ = 25_000_000.0
RATE_HZ = 50.0
MAX_CHANNELS = 16
WAKE_S = 0.0005  # until its oscillator runs

MODE1, MODE2, LED0, ALL_LED_OFF_H, PRE_SCALE = 0x00, 0x01, 0x06, 0xFD, 0xFE
EXTCLK, AUTO_INCREMENT, SLEEP = 0x40, 0x20, 0x10  # in MODE1
TOTEM_POLE = 0x04  # in MODE2; all channels change together, at the end of a transfer
FULL_OFF = 0x10  # in the high byte of an OFF count
_BYTES_PER_CHANNEL = 4
_BLOCK = MAX_BYTES // _BYTES_PER_CHANNEL  # channels


class Pca9685(PwmChip):
    """The first channels of a chip. It keeps its last pulses.

    Args:
        open_bus: opens the bus.
        address: 0x40 if no solder bridge is closed.
        channels, limits_us: as in PwmChip.
        oscillator_hz: as measured, or of the external clock.
        has_external_clock: that clock is at its EXTCLK pin. The chip leaves this mode only at power off.
        sleep: waits for its oscillator.

    Raises:
        ParameterError: it does not have that many channels, or a clock cannot make 50 Hz.
    """

    def __init__(
        self,
        open_bus: Callable[[], I2cBus],
        address: int,
        channels: int,
        limits_us: tuple[float, float] = LIMITS_US,
        oscillator_hz: float = OSCILLATOR_HZ,
        has_external_clock: bool = False,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        if not 1 <= channels <= MAX_CHANNELS:
            raise ParameterError(f"A PCA9685 cannot have {channels} channels.", fix=f"use 1 to {MAX_CHANNELS}.")
        self.prescale: int = round(oscillator_hz / (COUNTS * RATE_HZ)) - 1
        if not 3 <= self.prescale <= 255:
            raise ParameterError(
                f"A PCA9685 cannot make {RATE_HZ:g} Hz from a clock of {oscillator_hz:g} Hz.", fix="use 0.8 to 52 MHz."
            )
        self.count_us: float = (self.prescale + 1) / oscillator_hz * 1e6
        super().__init__(f"The PCA9685 at 0x{address:02x}", channels, limits_us, self.count_us)
        self.still_us: list[float] = self._pulses_of([self.count_of(STOP_US)] * channels)
        self._address, self._bus, self._sleep = address, WireHandle(open_bus, self), sleep
        self._mode = AUTO_INCREMENT | (EXTCLK if has_external_clock else 0)

    def count_of(self, pulse_us: float) -> int:
        """Return the count of steps that makes the nearest pulse inside the limits."""
        low, high = self.limits_us
        count = round(pulse_us / self.count_us)
        if count * self.count_us > high:
            return count - 1
        return count + 1 if count * self.count_us < low else count

    def open(self) -> None:
        """Initialise the chip: all outputs off, sleep, set the rate, wake, neutral.

        Raises:
            DeviceError: no device answers, or a register does not read back as written.
        """
        self._bus.open()
        self._write(ALL_LED_OFF_H, FULL_OFF)  # first: it may be driving a thruster; also required before sleep
        self._write(MODE1, AUTO_INCREMENT | SLEEP)  # it accepts a rate or another clock only asleep
        if self._mode & EXTCLK:
            self._write(MODE1, self._mode | SLEEP)
        self._write(PRE_SCALE, self.prescale)
        self._write(MODE2, TOTEM_POLE)
        self._write(MODE1, self._mode)
        self._sleep(WAKE_S)
        for register, name, expected in (
            (MODE1, "MODE1", self._mode),
            (MODE2, "MODE2", TOTEM_POLE),
            (PRE_SCALE, "PRE_SCALE", self.prescale),
        ):
            self._check(register, name, expected)
        self.send(self.still_us)

    def send(self, pulses_us: list[float]) -> list[float]:
        """Write counts, and check that the chip is still awake."""
        counts = [self.count_of(pulse) for pulse in pulses_us]
        for first in range(0, len(counts), _BLOCK):
            self._write(
                LED0 + _BYTES_PER_CHANNEL * first,
                *(byte for count in counts[first : first + _BLOCK] for byte in (0, 0, count & 0xFF, count >> 8)),
            )
        bus = self._bus.get()
        mode = bus.read(self._address, MODE1, 1)[0]
        if mode != self._mode:
            raise DeviceError(
                f"{self.title} on {bus.name} shows 0x{mode:02x} in MODE1, not 0x{self._mode:02x}: "
                "it was reset, so it makes no pulses.",
                fix="check its power for brown-outs, and that no other program uses it.",
            )
        return self._pulses_of(counts)

    def close(self) -> None:
        """Close the bus; the pulses continue at neutral."""
        self._bus.close()

    def _pulses_of(self, counts: list[int]) -> list[float]:
        return [count * self.count_us for count in counts]

    def _write(self, register: int, *data: int) -> None:
        self._bus.get().write(self._address, register, bytes(data))

    def _check(self, register: int, name: str, expected: int) -> None:
        bus = self._bus.get()
        found = bus.read(self._address, register, 1)[0]
        if found == expected:
            return
        if register == MODE1 and found == expected | EXTCLK:
            raise DeviceError(
                f"{self.title} on {bus.name} still uses the clock at its EXTCLK pin.",
                fix="switch its power off and on: only that restores its internal clock.",
            )
        raise DeviceError(
            f"The device at 0x{self._address:02x} on {bus.name} is not a PCA9685: {name} was written "
            f"0x{expected:02x} and reads 0x{found:02x}.",
            fix="another part has this address, too (an INA219 is at 0x40 as well): close a solder bridge of one.",
        )
