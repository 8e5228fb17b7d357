"""Fake I2C bus: parts that answer as their data sheets specify, behind the calls of smbus2.

For tests of drivers: `I2cBus(1, raw_bus.opened)`. Independent drivers run against the same parts.
"""

from __future__ import annotations

import errno
import os
from collections.abc import MutableSequence
from typing import Protocol

from snr_sim.devices.pwm.pca9685 import COUNTS, FULL_OFF, LED0, MODE1, OSCILLATOR_HZ, PRE_SCALE, SLEEP

_ALL_LED = 0xFA  # to 0xFD: writes here go to every channel
_AUTO_INCREMENT = 0x20
_EXTCLK = 0x40
_RESTART = 0x80


class I2cDevice(Protocol):
    """A part on the bus."""

    def write(self, register: int, data: list[int]) -> None:
        """Take the bytes written after a register number; none, if it was a command."""
        ...

    def read(self, register: int, length: int) -> list[int]:
        """Return the bytes read from a register on."""
        ...


class FakeBus:
    """I2C bus with the calls of smbus2 and the errors of the kernel.

    Args:
        parts: by address.

    Attributes:
        is_there: whether the parts answer: False simulates a disconnected wire.
        is_stuck: whether a device holds the clock line low.
    """

    def __init__(self, parts: dict[int, I2cDevice]) -> None:
        self.parts: dict[int, I2cDevice] = parts
        self.is_there: bool = True
        self.is_stuck: bool = False
        self.opened_times: int = 0
        self.closed_times: int = 0

    def opened(self, number: int) -> FakeBus:
        """Return the bus, as opening it does."""
        self.opened_times += 1
        return self

    def read_byte(self, i2c_addr: int) -> int:
        """Read a byte."""
        self._part(i2c_addr)
        return 0

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Write a command."""
        self._part(i2c_addr).write(value, [])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read a block."""
        _check(length)
        return self._part(i2c_addr).read(register, length)

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: list[int]) -> None:
        """Write a block."""
        _check(len(data))
        self._part(i2c_addr).write(register, data)

    def close(self) -> None:
        """Count."""
        self.closed_times += 1

    def _part(self, address: int) -> I2cDevice:
        if self.is_stuck:
            raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))
        if not self.is_there or address not in self.parts:
            raise OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))
        return self.parts[address]


def _check(length: int) -> None:
    if not 1 <= length <= 32:
        raise OSError(errno.EINVAL, f"an SMBus block of {length} bytes")


class FakePca9685:
    """The registers of a PCA9685, with the rules between them, and the pulses at its pins.

    Args:
        oscillator_hz: how fast its oscillator really is.
        registers: where they are kept, 256 of them, such as a file in memory that two processes see.
    """

    def __init__(self, oscillator_hz: float = OSCILLATOR_HZ, registers: MutableSequence[int] | None = None) -> None:
        self.oscillator_hz: float = oscillator_hz
        self.registers: MutableSequence[int] = bytearray(256) if registers is None else registers
        if registers is None:
            self.power_on()

    def power_on(self) -> None:
        """Have the values after power on: asleep, all channels off."""
        for register in range(256):
            self.registers[register] = 0
        self.registers[MODE1], self.registers[MODE1 + 1], self.registers[PRE_SCALE] = 0x11, 0x04, 0x1E
        for channel in range(16):
            self.registers[LED0 + 4 * channel + 3] = FULL_OFF

    def write(self, register: int, data: list[int]) -> None:
        """Take bytes; without auto-increment all of them go to one register."""
        for byte in data:
            self._put(register, byte)
            if self.registers[MODE1] & _AUTO_INCREMENT:
                register = (register + 1) % 256

    def read(self, register: int, length: int) -> list[int]:
        """Return bytes; without auto-increment always the same one."""
        step = 1 if self.registers[MODE1] & _AUTO_INCREMENT else 0
        return [self.registers[(register + i * step) % 256] for i in range(length)]

    def pins_us(self, channels: int = 16) -> list[float]:
        """Return the pulse on each channel; 0 for none."""
        if self.registers[MODE1] & SLEEP:
            return [0.0] * channels
        step_us = (self.registers[PRE_SCALE] + 1) / self.oscillator_hz * 1e6
        return [self._count(channel) * step_us for channel in range(channels)]

    def _count(self, channel: int) -> int:
        on_l, on_h, off_l, off_h = (self.registers[LED0 + 4 * channel + i] for i in range(4))
        if off_h & FULL_OFF:
            return 0
        return ((off_l | (off_h & 0x0F) << 8) - (on_l | (on_h & 0x0F) << 8)) % COUNTS

    def _put(self, register: int, byte: int) -> None:
        if register == PRE_SCALE and not self.registers[MODE1] & SLEEP:
            return  # the rate can be written in sleep mode only
        if _ALL_LED <= register < _ALL_LED + 4:
            for channel in range(16):
                self.registers[LED0 + 4 * channel + register - _ALL_LED] = byte
            return
        if register == MODE1:
            byte = self._mode1(byte)
        self.registers[register] = byte

    def _mode1(self, byte: int) -> int:
        before = self.registers[MODE1]
        if before & _EXTCLK or (byte & _EXTCLK and before & SLEEP and byte & SLEEP):
            byte |= _EXTCLK  # accepted in sleep mode only, and kept until power off
        else:
            byte &= ~_EXTCLK
        runs = any(self._count(channel) for channel in range(16))
        if byte & SLEEP and not before & SLEEP and runs:
            return byte | _RESTART  # set to sleep while channels run: a restart could resume them
        kept = before & _RESTART if not byte & _RESTART else 0  # writing 1 clears it
        return byte & ~_RESTART | kept
