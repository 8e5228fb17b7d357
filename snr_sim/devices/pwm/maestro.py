"""A Pololu Maestro: servo pulses from a small board on USB, in steps of a quarter microsecond.

It goes to its home positions when commands stop, but only if its owner has configured that: its serial timeout is off
when it is new, and a channel's home may be "ignore". Neither setting can be read, so `configure` tests it: it sends
1501 us to all channels, which every speed controller takes as stop, then nothing. A quarter of a second later the board
must report its timeout, and all channels at 1500 us. Therefore it counts as failing safe alone.

In Maestro Control Center: Serial mode "USB Dual Port", Timeout 0.20 s; each channel "Servo", 8-bit neutral and
"On startup or error: Go to" 1500. The port is its command port, the first of the two that appear.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

from snr_sim.devices.pwm.passive_pwm import PwmChip
from snr_sim.devices.pwm.pwm_backend import LIMITS_US, STOP_US
from snr_sim.devices.wire import maestro as wire
from snr_sim.devices.wire.maestro import MaestroError
from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.devices.wire.wire_handle import WireHandle
from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.errors import DeviceError

ANSWER_S = 0.5
PROBE_US = STOP_US + 1.0
SILENCE_S = LEASE_S + 0.04  # by then a timeout that is set as above has expired
MAX_ERRORS = 5  # in a row
_ALL_ERRORS = sum(MaestroError)  # exact: integers


class Maestro(PwmChip):
    """The channels of a Maestro, from 0 on.

    Args:
        open_port: opens the port.
        now_s: the clock of its timeout.
        channels, limits_us: as in PwmChip.
        has_crc: whether "Enable CRC" is on in its settings.
        sleep: waits during the test of its timeout.
    """

    has_independent_failsafe = True

    def __init__(
        self,
        open_port: Callable[[], BytePort],
        now_s: Callable[[], float],
        channels: int,
        limits_us: tuple[float, float] = LIMITS_US,
        has_crc: bool = False,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        super().__init__("The Maestro", channels, limits_us, 1.0 / wire.QUARTERS_PER_US)
        self._now_s, self._sleep, self._has_crc = now_s, sleep, has_crc
        self._port = WireHandle(open_port, self)
        self._counts: Counter[str] = Counter()
        self._query_times_s: list[float] = []  # times of error queries that are not answered yet
        self._received = b""
        self._consecutive_errors = 0
        self._sent_s = now_s()

    def counts(self) -> dict[str, int]:
        """Return the number of occurrences of each error."""
        return dict(self._counts)

    def open(self) -> None:
        """Open the port, identify the board, and test whether it fails safe.

        Raises:
            DeviceError: no device answers, or not a Maestro; or its outputs would stay on if this program were killed.
        """
        self.title: str = f"The Maestro on {self._port.open().name}"
        try:
            self._identify()
            self._test_timeout()
        except BaseException:
            self.close()
            raise
        self._reset_errors()
        self._command(self.still_us)

    def before_arming(self) -> None:
        """Discard errors from the time in which nothing was sent."""
        self._ask(wire.GET_ERRORS, "its errors")
        self._reset_errors()

    def send(self, pulses_us: list[float]) -> list[float]:
        """Send targets. If the board went home since the last call, send neutral instead."""
        silent_s = self._now_s() - self._sent_s
        self.tripped: str = ""
        if silent_s > LEASE_S:
            self.tripped = f"it was sent nothing for {silent_s:.2f} s, so its timeout came"
            pulses_us = self.still_us
        if self._exchange(pulses_us) & MaestroError.TIMEOUT and not self.tripped:
            self.tripped = "its serial timeout came: it went to its home positions by itself"
            pulses_us = self.still_us
            self._exchange(pulses_us)
        return pulses_us

    def _exchange(self, pulses_us: list[float]) -> MaestroError:
        """Send targets and query errors; return the answers that have arrived to this and earlier queries."""
        self._command(pulses_us)
        self._write(wire.GET_ERRORS)
        self._query_times_s.append(self._now_s())
        return self._receive()

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def _identify(self) -> None:
        """Check that it answers as a Maestro and has enough channels."""
        self._ask(wire.GET_ERRORS, "its errors")
        errors = self._ask(wire.GET_ERRORS, "its errors")  # the first answer may report old errors
        if errors & ~_ALL_ERRORS:
            raise DeviceError(
                f"{self.title} reports the errors 0x{errors:04x}, with bits that no Maestro has: it is another device.",
                fix="`snr doctor` lists the ports with their devices.",
            )
        if errors:
            raise DeviceError(
                f"{self.title} rejects commands: {wire.describe_errors(errors)}.",
                fix="set has_crc to the same value as 'Enable CRC' in its settings; close other programs on the port.",
            )
        self._ask(wire.get_position(self.channels - 1), f"channel {self.channels - 1}")

    def _test_timeout(self) -> None:
        """Check that all channels go to neutral when commands stop."""
        self._command([PROBE_US] * self.channels)
        for channel in range(self.channels):
            self._check_channel(channel, PROBE_US, "its mode is not 'Servo', or a speed or acceleration limits it")
        self._sleep(SILENCE_S)
        errors = self._ask(wire.GET_ERRORS, "its errors")
        if not errors & MaestroError.TIMEOUT:
            raise DeviceError(
                f"{self.title} did not time out after {SILENCE_S:.2f} s without commands: if this program were killed, "
                "its motors would continue to run.",
                fix="in Maestro Control Center, Serial Settings: Timeout 0.20 s, Apply Settings. It is off when new.",
            )
        for channel in range(self.channels):
            self._check_channel(channel, STOP_US, "on an error it does not go to 1500 us")

    def _check_channel(self, channel: int, expected_us: float, otherwise: str) -> None:
        made_us = self._ask(wire.get_position(channel), f"channel {channel}") / 4.0
        if made_us != expected_us:
            raise DeviceError(
                f"{self.title}: channel {channel} makes {made_us:g} us, not {expected_us:g}: {otherwise}.",
                fix="in Maestro Control Center, Channel Settings: mode Servo, speed and acceleration 0, "
                "On startup or error: Go to 1500.",
            )

    def _ask(self, question: bytes, about: str) -> int:
        port = self._port.get()
        port.read()  # discards what was received earlier
        self._write(question)
        answer = port.read()
        until_s = time.monotonic() + ANSWER_S
        while len(answer) < wire.ANSWER_BYTES and port.wait(max(0.0, until_s - time.monotonic())):
            answer += port.read()
        if not answer:
            raise DeviceError(
                f"{self.title} does not answer when asked for {about}: 0 bytes in {ANSWER_S:g} s.",
                fix="check its port (the command port is the first of two), serial mode 'USB Dual Port', power, "
                "'Enable CRC' and its number of channels.",
            )
        if len(answer) != wire.ANSWER_BYTES:
            raise DeviceError(
                f"{self.title} answers {len(answer)} bytes when asked for {about}, a Maestro {wire.ANSWER_BYTES}: "
                f"{answer[:16].hex(' ')}.",
                fix="`snr doctor` shows whether another device or program is on this port.",
            )
        return int.from_bytes(answer, "little")

    def _command(self, pulses_us: list[float]) -> None:
        self._write(*wire.set_targets(pulses_us))

    def _write(self, *commands: bytes) -> None:
        self._port.get().write(b"".join(map(self._encode, commands)))
        self._sent_s = self._now_s()

    def _encode(self, command: bytes) -> bytes:
        return command + bytes([wire.crc7(command)]) if self._has_crc else command

    def _receive(self) -> MaestroError:
        """Return the answers to error queries without waiting."""
        self._received += self._port.get().read()
        errors = MaestroError(0)
        while len(self._received) >= wire.ANSWER_BYTES:
            number = int.from_bytes(self._received[: wire.ANSWER_BYTES], "little")
            self._received = self._received[wire.ANSWER_BYTES :]
            if not self._query_times_s or number & ~_ALL_ERRORS:
                raise DeviceError(
                    f"{self.title} sends bytes that were not requested.", fix="close other programs that use this port."
                )
            self._query_times_s.pop(0)
            self._count(MaestroError(number))
            errors |= MaestroError(number)
        if self._query_times_s and self._now_s() > self._query_times_s[0] + ANSWER_S:
            raise DeviceError(f"{self.title} has not answered for {ANSWER_S:g} s.", fix="check its cable and power.")
        return errors

    def _count(self, errors: MaestroError) -> None:
        self._counts.update(bit.name.lower() for bit in MaestroError if bit & errors and bit.name)
        self._consecutive_errors = self._consecutive_errors + 1 if errors & ~MaestroError.TIMEOUT else 0
        if self._consecutive_errors >= MAX_ERRORS:
            raise DeviceError(
                f"{self.title} rejected {self._consecutive_errors} commands in a row: {wire.describe_errors(errors)}.",
                fix="use a shorter cable, and close other programs that use the port.",
            )

    def _reset_errors(self) -> None:
        self._sent_s = self._now_s()
        self._query_times_s, self._received, self._consecutive_errors = [], b"", 0
