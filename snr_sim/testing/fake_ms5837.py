"""An MS5837-30BA without a chip: commands in, calibration and counts out, in its own time. For `FakeBus`."""

from __future__ import annotations

from collections.abc import Callable

from snr_sim.devices.wire.ms5837_bytes import compensated, crc4

_DATA_SHEET = (0, 34982, 36352, 20328, 22354, 26646, 26146)  # C0 to C6 of its example
_S_PER_SAMPLE = 2.2e-6  # of a conversion, at most


class FakeMs5837:
    """The part.

    Args:
        now_s: the clock of its conversions.
        pressure_pa, temperature_c: the quantities measured.

    Attributes:
        d1, d2: raw conversion results; `set_environment` sets them.
        words: of its PROM.
    """

    def __init__(self, now_s: Callable[[], float], pressure_pa: float = 101_325.0, temperature_c: float = 20.0) -> None:
        self._now_s = now_s
        self.words: list[int] = [_DATA_SHEET[0] | crc4([*_DATA_SHEET, 0]) << 12, *_DATA_SHEET[1:]]
        self._is_reset = False
        self._adc, self._done_s = 0, 0.0
        self.commands: list[int] = []
        self.set_environment(pressure_pa, temperature_c)

    def set_environment(self, pressure_pa: float, temperature_c: float) -> None:
        """Set the counts that this becomes."""
        self.d2: int = _solve(lambda d2: compensated(_DATA_SHEET, 0, d2)[1] - temperature_c)
        self.d1: int = _solve(lambda d1: compensated(_DATA_SHEET, d1, self.d2)[0] - pressure_pa)

    def power_on(self) -> None:
        """Reset its state."""
        self._adc, self._is_reset = 0, False

    def write(self, register: int, data: list[int]) -> None:
        """Take a command."""
        self.commands.append(register)
        if register == 0x1E:
            self.power_on()
            self._is_reset = True
        elif 0x40 <= register <= 0x5A:
            samples = 256 << (register & 0x0F) // 2
            self._done_s = self._now_s() + _S_PER_SAMPLE * samples
            self._adc = self.d1 if register < 0x50 else self.d2

    def read(self, register: int, length: int) -> list[int]:
        """Return a word of the PROM, or the newest conversion, once: 0 if it is not finished."""
        if register >= 0xA0:
            word = self.words[(register - 0xA0) // 2] if self._is_reset else 0
            return list(word.to_bytes(2, "big"))[:length]
        adc = self._adc if self._now_s() >= self._done_s - 1e-9 else 0
        self._adc = 0
        return list(adc.to_bytes(3, "big"))[:length]


def _solve(off: Callable[[int], float]) -> int:
    """Return the count of 24 bits where a rising function passes zero."""
    low, high = 0, 2**24 - 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if off(middle) > 0 else (middle, high)
    return low
