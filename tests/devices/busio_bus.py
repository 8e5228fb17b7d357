"""Parts of `testing/fake_i2c.py` behind the calls of CircuitPython's `busio.I2C`, for drivers that run against those.

PCA9685(BusioBus({0x40: FakePca9685()}))        # adafruit_pca9685, which is not ours
"""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping

from snr_sim.testing.fake_i2c import I2cDevice


class BusioBus:
    """A bus as CircuitPython sees it: raw bytes, the first of a write being the register.

    Args:
        parts: by address.
    """

    def __init__(self, parts: Mapping[int, I2cDevice]) -> None:
        self._parts = parts
        self._registers: dict[int, int] = {}

    def try_lock(self) -> bool:
        """Return that it is ours."""
        return True

    def unlock(self) -> None:
        """Let others have it; there are none."""

    def writeto(self, address: int, buffer: bytes, *, start: int = 0, end: int | None = None) -> None:
        """Write."""
        part, data = self._part(address), list(buffer[start:end])
        if data:
            self._registers[address] = data[0]
        if len(data) > 1:
            part.write(data[0], data[1:])

    def readfrom_into(self, address: int, buffer: bytearray, *, start: int = 0, end: int | None = None) -> None:
        """Read from the register that was written last."""
        length = len(buffer[start:end])
        buffer[start : start + length] = bytes(self._part(address).read(self._registers.get(address, 0), length))

    def writeto_then_readfrom(
        self,
        address: int,
        out_buffer: bytes,
        in_buffer: bytearray,
        *,
        out_start: int = 0,
        out_end: int | None = None,
        in_start: int = 0,
        in_end: int | None = None,
    ) -> None:
        """Write, then read."""
        self.writeto(address, out_buffer, start=out_start, end=out_end)
        self.readfrom_into(address, in_buffer, start=in_start, end=in_end)

    def _part(self, address: int) -> I2cDevice:
        if address not in self._parts:
            raise OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))
        return self._parts[address]
