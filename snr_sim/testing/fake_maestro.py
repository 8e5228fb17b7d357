"""Fake Maestro: bytes in, pulses at its pins and answers out, as in its user's guide.

For tests of the driver. Its timeout uses a clock of the test's.
"""

from __future__ import annotations

from collections.abc import Callable

from snr_sim.devices.wire.maestro import MaestroError, crc7
from snr_sim.prelude.errors import DeviceError

_LENGTHS = {0x84: 4, 0x90: 2, 0xA1: 1, 0xA2: 1}  # of whole commands; 0x9F contains its own length


class FakeMaestro:
    """Board and the port that leads to it. Implements `BytePort`.

    Args:
        now_s: the clock of its timeout.
        channels: number of channels.
        timeout_s: its serial timeout; 0 is off, the factory setting.
        home_us: position of the channels on an error; 0 is off, None is "Ignore".
        has_crc: whether "Enable CRC" is on.

    Attributes:
        pins_us: the pulse on each channel; 0 for none.
        is_plugged: whether the cable is connected. The board has power either way.
    """

    name = "/dev/ttyACM0"

    def __init__(
        self,
        now_s: Callable[[], float],
        channels: int = 8,
        timeout_s: float = 0.2,
        home_us: float | None = 1500.0,
        has_crc: bool = False,
    ) -> None:
        self._now_s = now_s
        self.timeout_s: float = timeout_s
        self.home_us: float | None = home_us
        self.has_crc: bool = has_crc
        self._pins_us = [home_us or 0.0] * channels
        self._errors = MaestroError(0)
        self._command = b""
        self._answers = b""
        self._last_command_s = now_s()
        self.is_plugged: bool = True
        self.closed_times: int = 0

    @property
    def pins_us(self) -> list[float]:
        """The pulse on each channel, now."""
        self._check_timeout()
        return list(self._pins_us)

    def write(self, data: bytes) -> None:
        """Take bytes."""
        self._check_cable()
        self._check_timeout()
        for byte in data:
            self._take(byte)

    def read(self) -> bytes:
        """Return the answers so far."""
        self._check_cable()
        answers, self._answers = self._answers, b""
        return answers

    def wait(self, seconds: float) -> bool:
        """Return whether there are answers; more do not come by waiting."""
        return bool(self._answers)

    def close(self) -> None:
        """Count."""
        self.closed_times += 1

    def _check_cable(self) -> None:
        if not self.is_plugged:
            raise DeviceError(f"{self.name} is gone: [Errno 5] Input/output error.", fix="is the cable in?")

    def _check_timeout(self) -> None:
        if self.timeout_s and self._now_s() > self._last_command_s + self.timeout_s:
            self._err(MaestroError.TIMEOUT)

    def _take(self, byte: int) -> None:
        if byte & 0x80:
            if self._command:
                self._err(MaestroError.PROTOCOL)  # one command cut short by another
            self._command = b""
        elif not self._command:
            self._err(MaestroError.PROTOCOL)  # data without a command
            return
        self._command += bytes([byte])
        length = self._length()
        if length == 0:
            self._err(MaestroError.PROTOCOL)
            self._command = b""
        elif len(self._command) == length + self.has_crc:
            command, self._command = self._command, b""
            if self.has_crc and crc7(command[:-1]) != command[-1]:
                self._err(MaestroError.CRC)
            else:
                self._execute(command[:length])

    def _length(self) -> int:
        """Return how long the command is that has begun; 0 if there is none such."""
        if self._command[0] != 0x9F:
            return _LENGTHS.get(self._command[0], 0)
        return 99 if len(self._command) < 2 else 3 + 2 * self._command[1]

    def _execute(self, command: bytes) -> None:
        kind, first = command[0], command[1] if len(command) > 1 else 0
        if kind == 0x9F:
            first, count, numbers = command[2], command[1], command[3:]
        else:
            count, numbers = 1, command[2:]
        if first + count > len(self._pins_us) or (kind == 0x9F and len(self._pins_us) <= 6):
            self._err(MaestroError.PROTOCOL)
            return
        self._last_command_s = self._now_s()
        if kind == 0xA2:
            self._go_home()
        elif kind == 0xA1:
            self._answers += int(self._errors).to_bytes(2, "little")
            self._errors = MaestroError(0)
        elif kind == 0x90:
            self._answers += round(self._pins_us[first] * 4).to_bytes(2, "little")
        else:
            for i in range(count):
                self._pins_us[first + i] = (numbers[2 * i] | numbers[2 * i + 1] << 7) / 4

    def _err(self, error: MaestroError) -> None:
        self._errors |= error
        self._go_home()

    def _go_home(self) -> None:
        if self.home_us is not None:
            self._pins_us = [self.home_us] * len(self._pins_us)
