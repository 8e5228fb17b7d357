"""Identification of the device at the other end of a serial port: the microcontroller with our firmware, or another.

Opening the port of most Arduinos resets them; then a boot loader listens for up to two seconds before the firmware
starts. So the greeting is repeated until a timeout, and received bytes are kept to be shown if no valid answer comes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import PROTOCOL, TYPE_OF, AckResult, CommandAck, FromMcu, Hello, Ident, Telemetry
from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.prelude.errors import DeviceError

FLASH = "flash the firmware that belongs to this kit: robots/urov/firmware/README.md."
_RETRY_PERIOD_S = 0.5  # not more often: some boot loaders stay as long as they receive bytes
_SHOWN = 16  # bytes


@dataclass
class _Received:
    """The bytes and messages received since the greeting."""

    data: bytes = b""
    telemetry: int = 0


def handshake(
    port: BytePort, frames: McuFrames, session: int, timeout_s: float, line_s: Callable[[], float]
) -> tuple[Ident, list[FromMcu]]:
    """Send a greeting and wait for the answer; return it, and the messages after it.

    Args:
        port: open.
        frames: decodes the bytes.
        session: of this greeting.
        timeout_s: how long to wait, by `line_s`; a boot loader takes up to 2 s.
        line_s: the clock of the line.

    Raises:
        DeviceError: no device answers, another one does, or the firmware has another version.
    """
    received = _Received()
    end_s = line_s() + timeout_s
    sent_s = -_RETRY_PERIOD_S
    while (now_s := line_s()) < end_s:
        if now_s >= sent_s + _RETRY_PERIOD_S or sent_s < 0.0:
            port.write(b"\0" + encode(Hello(session)))  # the zero ends any partial frame
            sent_s = now_s
        port.wait(min(end_s, sent_s + _RETRY_PERIOD_S) - now_s)
        data = port.read()
        if len(received.data) < _SHOWN:
            received.data += data[:_SHOWN]
        messages = frames.feed(data)
        for i, message in enumerate(messages):
            if isinstance(message, Telemetry):
                received.telemetry += 1
            elif isinstance(message, Ident):
                _check_version(port, message)
                if message.session == session:
                    return message, [one for one in messages[i + 1 :] if isinstance(one, Telemetry | CommandAck)]
            elif isinstance(message, CommandAck) and message.to == TYPE_OF[Hello]:
                _check_ack(port, message)
    raise _no_answer_error(port, received, timeout_s)


def _check_version(port: BytePort, ident: Ident) -> None:
    if ident.protocol != PROTOCOL:
        firmware = ".".join(map(str, ident.firmware))
        raise DeviceError(
            f"{port.name}: firmware {firmware} of '{ident.name}' speaks protocol {ident.protocol}, "
            f"this program protocol {PROTOCOL}.",
            fix=FLASH,
        )


def _check_ack(port: BytePort, ack: CommandAck) -> None:
    if ack.result == AckResult.OTHER_PROTOCOL:
        raise DeviceError(
            f"{port.name}: its firmware does not speak protocol {PROTOCOL}, which this program uses.",
            fix=FLASH,
        )


def _no_answer_error(port: BytePort, received: _Received, timeout_s: float) -> DeviceError:
    """Return the error for a missing answer, chosen by the received bytes."""
    within = f"{port.name}: no answer to the greeting in {timeout_s:g} s"
    if not received.data:
        return DeviceError(
            f"{within}; no byte was received.",
            fix=f"check the port and the power of the board; then {FLASH}",
        )
    seen = in_hex(received.data)
    if received.telemetry:
        return DeviceError(
            f"{within}, but its telemetry arrives ({seen}).", fix="check the wire TX: sent bytes do not arrive."
        )
    text = received.data.decode("ascii", "replace")
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


def in_hex(data: bytes) -> str:
    """Return the first bytes as hexadecimal text for a message.

    >>> in_hex(b"$GP")
    '24 47 50'
    """
    return data[:_SHOWN].hex(" ") + (" ..." if len(data) > _SHOWN else "")
