"""Fake ICM-20948 with its magnetometer: registers, and the quantities that they measure. For `FakeBus`."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

_GRAVITY_MPS2 = 9.80665
_FULL_SCALE = {0: 250.0, 1: 500.0, 2: 1000.0, 3: 2000.0}  # deg/s; of forces 2, 4, 8, 16 g
_SLEEP, _RESET, _BYPASS = 0x40, 0x80, 0x02


class FakeIcm20948:
    """The unit.

    Attributes:
        rate_radps, force_mps2: angular rate and specific force, in the axes printed on it.
        identity: value of its WHO_AM_I register.
    """

    def __init__(self) -> None:
        self.rate_radps: Sequence[float] = (0.0, 0.0, 0.0)
        self.force_mps2: Sequence[float] = (0.0, 0.0, _GRAVITY_MPS2)
        self.identity: int = 0xEA
        self.power_on()

    def power_on(self) -> None:
        """Have the values after power on: asleep."""
        self._bank = 0
        self._registers = [bytearray(128) for _ in range(4)]
        self._registers[0][0x06] = 0x41
        self._registers[2][0x01] = self._registers[2][0x14] = 0x01

    @property
    def shows_compass(self) -> bool:
        """Whether the magnetometer's wires are joined to the bus."""
        return bool(self._registers[0][0x0F] & _BYPASS)

    def write(self, register: int, data: list[int]) -> None:
        """Take bytes, register after register."""
        for i, byte in enumerate(data, register):
            if i == 0x7F:
                self._bank = byte >> 4 & 3
            elif self._bank == 0 and i == 0x06 and byte & _RESET:
                self.power_on()
            else:
                self._registers[self._bank][i] = byte

    def read(self, register: int, length: int) -> list[int]:
        """Return bytes, register after register."""
        self._registers[0][0x00] = self.identity
        self._registers[0][0x2D:0x39] = self._raw_measurements()
        return list(self._registers[self._bank][register : register + length])

    def _raw_measurements(self) -> bytes:
        if self._registers[0][0x06] & _SLEEP:
            return bytes(12)
        gyro = _FULL_SCALE[self._registers[2][0x01] >> 1 & 3]
        accel = _FULL_SCALE[self._registers[2][0x14] >> 1 & 3] / 125.0
        # The data sheet's scales are rounded: 65.5 counts per deg/s at 500, 8192 per g at 4.
        rates = [math.degrees(one) * round(327.5e2 / gyro, 1) for one in self.rate_radps]
        forces = [one / _GRAVITY_MPS2 * 32768 / accel for one in self.force_mps2]
        return struct.pack(">6h", *(max(-32768, min(32767, round(one))) for one in (*forces, *rates)))


class FakeAk09916:
    """Magnetometer, on the auxiliary bus of the unit.

    Args:
        unit: the magnetometer answers only if the unit has connected it to the bus.

    Attributes:
        field_ut: magnetic field in microtesla, in the axes printed on the package; its own y and z are opposite.
        is_too_strong: whether it reports an overflow.
    """

    def __init__(self, unit: FakeIcm20948) -> None:
        self._unit = unit
        self.field_ut: Sequence[float] = (0.0, 20.0, -40.0)
        self.identity: int = 0x09
        self.is_too_strong: bool = False
        self._mode = 0

    def write(self, register: int, data: list[int]) -> None:
        """Take its mode."""
        if register == 0x31:
            self._mode = data[0]

    def read(self, register: int, length: int) -> list[int]:
        """Return bytes."""
        if not self._unit.shows_compass:
            raise OSError(121, "Remote I/O error")
        registers = bytearray(0x40)
        registers[0x01] = self.identity
        x, y, z = self.field_ut
        if self._mode:
            counts = (round(one / 0.15) for one in (x, -y, -z))
            registers[0x10:0x19] = struct.pack("<B3hBB", 1, *counts, 0, 0x08 if self.is_too_strong else 0)
        return list(registers[register : register + length])
