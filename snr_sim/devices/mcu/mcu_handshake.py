"""Identification of the device at the other end of a serial port: the microcontroller with our firmware, or another.

Opening the port of most Arduinos resets them; then a boot loader listens for up to two seconds before the firmware
starts. So the greeting is repeated until a timeout, and received bytes are kept to be shown if no valid answer comes.

Its identity decides whether it may drive thrusters. The computer clamps and counts leases, too; but when the computer
fails, only the firmware's limits remain.
"""

from __future__ import annotations

from collections.abc import Callable

from snr_sim.devices.pwm.pwm_backend import LIMITS_US, STOP_US
from snr_sim.devices.wire import mcu_messages as wire
from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.prelude.errors import DeviceError

FLASH = "flash the firmware that belongs to this kit: robots/urov/firmware/README.md."
NAME, CHANNELS = "snr_sim esc", 8  # of our firmware, robots/urov/firmware
MAX_LEASE_MS = 250  # thrusters stop within this time after a computer has failed (docs/hardware.md, H1)
MAX_SLEW_US_PER_100MS = 400  # H7 there
MIN_ESC_START_MS = 1000  # a Basic ESC needs neutral for about so long (Blue Robotics), H4
_RETRY_PERIOD_S = 0.5  # not more often: some boot loaders stay as long as they receive bytes
_SHOWN = 16  # bytes


def handshake(
    port: BytePort, frames: McuFrames, session: int, timeout_s: float, line_s: Callable[[], float]
) -> tuple[wire.Ident, list[wire.FromMcu]]:
    """Send a greeting and wait for the answer; return it, and the messages after it.

    Args:
        session: of this greeting.
        timeout_s: how long to wait, by `line_s`; a boot loader takes up to 2 s.
        line_s: the clock of the line.

    Raises:
        DeviceError: no device answers, another one does, or the firmware has another version.
    """
    received, has_telemetry = b"", False
    end_s = line_s() + timeout_s
    sent_s = -_RETRY_PERIOD_S
    while (now_s := line_s()) < end_s:
        if now_s >= sent_s + _RETRY_PERIOD_S or sent_s < 0.0:
            port.write(b"\0" + encode(wire.Hello(session)))  # the zero ends any partial frame
            sent_s = now_s
        port.wait(min(end_s, sent_s + _RETRY_PERIOD_S) - now_s)
        data = port.read()
        if len(received) < _SHOWN:
            received += data[:_SHOWN]
        messages = frames.feed(data)
        for i, message in enumerate(messages):
            _check_version(port.name, message)
            if isinstance(message, wire.Ident) and message.session == session:
                return message, [one for one in messages[i + 1 :] if isinstance(one, wire.Telemetry | wire.CommandAck)]
        has_telemetry = has_telemetry or any(isinstance(message, wire.Telemetry) for message in messages)
    raise _no_answer_error(port.name, received, has_telemetry, timeout_s)


def _check_version(port: str, message: wire.ToMcu | wire.FromMcu) -> None:
    if isinstance(message, wire.Ident) and message.protocol != wire.PROTOCOL:
        firmware = ".".join(map(str, message.firmware))
        raise DeviceError(
            f"{port}: firmware {firmware} of '{message.name}' speaks protocol {message.protocol}, "
            f"this program protocol {wire.PROTOCOL}.",
            fix=FLASH,
        )
    refusal = (wire.TYPE_OF[wire.Hello], wire.AckResult.OTHER_PROTOCOL)
    if isinstance(message, wire.CommandAck) and (message.to, message.result) == refusal:
        raise DeviceError(
            f"{port}: its firmware does not speak protocol {wire.PROTOCOL}, which this program uses.", fix=FLASH
        )


def _no_answer_error(port: str, received: bytes, has_telemetry: bool, timeout_s: float) -> DeviceError:
    within = f"{port}: no answer to the greeting in {timeout_s:g} s"
    if not received:
        return DeviceError(
            f"{within}; no byte was received.",
            fix=f"check the port and the power of the board; then {FLASH}",
        )
    seen = received[:_SHOWN].hex(" ") + (" ..." if len(received) > _SHOWN else "")
    if has_telemetry:
        return DeviceError(
            f"{within}, but its telemetry arrives ({seen}).", fix="check the wire TX: sent bytes do not arrive."
        )
    text = received.decode("ascii", "replace")
    if sum(one.isprintable() or one in "\r\n\t" for one in text) >= 0.9 * len(text):  # exact: integers
        shown = text[:_SHOWN].encode("unicode_escape").decode()
        return DeviceError(
            f"{within}. Another device sends '{shown}' ({seen}).",
            fix="use the port of the microcontroller: `snr doctor` lists the ports.",
        )
    return DeviceError(
        f"{within}. The received bytes ({seen}) are not one of its frames.",
        fix=f"wrong baud rate, or another device; if it is the microcontroller, {FLASH}",
    )


def check_identity(port: str, ident: wire.Ident, channels: int) -> None:
    """Raise a DeviceError with all differences if the board at a port does not meet the requirements."""
    wrong = incompatibilities(ident, channels)
    if wrong:
        raise DeviceError(
            f"{port}: the board there must not drive thrusters. It reports: {'; '.join(wrong)}.",
            fix=FLASH if channels <= CHANNELS else f"our firmware has {CHANNELS} channels: add a second board.",
        )


def incompatibilities(ident: wire.Ident, channels: int) -> list[str]:
    """Return each field of a board's identity that does not fit, with the required value; empty if all fit."""
    low_us, high_us = LIMITS_US
    limits_fit = low_us <= ident.lowest_us < STOP_US < ident.highest_us <= high_us
    requirements = (
        (ident.name == NAME, f"its name is '{ident.name}'", f"'{NAME}', our firmware's"),
        (ident.channels >= channels, f"{ident.channels} channels", f"{channels} at least"),
        (ident.neutral_us == STOP_US, f"neutral {ident.neutral_us:g} us", f"{STOP_US:g}"),
        (
            limits_fit,
            f"limits {ident.lowest_us:g} to {ident.highest_us:g} us",
            f"around {STOP_US:g} and within {low_us:g} to {high_us:g}",
        ),
        (
            1 <= ident.max_lease_ms <= MAX_LEASE_MS,
            f"a lease of {ident.max_lease_ms} ms at most",
            f"1 to {MAX_LEASE_MS}",
        ),
        (
            1 <= ident.slew_us_per_100ms <= MAX_SLEW_US_PER_100MS,
            f"slew {ident.slew_us_per_100ms} us in 100 ms",
            f"1 to {MAX_SLEW_US_PER_100MS}",
        ),
        (ident.dwell_ms >= 1, f"a rest of {ident.dwell_ms} ms between ahead and astern", "more than 0"),
        (
            ident.esc_start_ms >= MIN_ESC_START_MS,
            f"neutral shown for {ident.esc_start_ms} ms before arming",
            f"{MIN_ESC_START_MS} at least",
        ),
    )
    return [f"{actual} (required: {required})" for fits, actual, required in requirements if not fits]
