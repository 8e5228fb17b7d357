"""Identification of the device at the other end of a serial port: the microcontroller with our firmware, or another.

Opening the port of most Arduinos resets them; then a boot loader listens for up to two seconds before the firmware
starts. So the greeting is repeated until a timeout, and received bytes are kept to be shown if no valid answer comes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import PROTOCOL, TYPE_OF, Answer, FromMcu, Hello, Ident, Result, Telemetry
from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.prelude.errors import DeviceError

FLASH = "flash the firmware that belongs to this kit: robots/urov/firmware/README.md."
_AGAIN_S = 0.5  # not more often: some boot loaders stay as long as they receive bytes
_SHOWN = 16  # bytes


@dataclass
class _Heard:
    """The bytes and messages received since the greeting."""

    data: bytes = b""
    telemetry: int = 0


def greet(
    port: BytePort, frames: McuFrames, session: int, patience_s: float, line_s: Callable[[], float]
) -> tuple[Ident, list[FromMcu]]:
    """Send a greeting and wait for the answer; return it, and the messages after it.

    Args:
        port: open.
        frames: decodes the bytes.
        session: of this greeting.
        patience_s: how long to wait, by `line_s`; a boot loader takes up to 2 s.
        line_s: the clock of the line.

    Raises:
        DeviceError: no device answers, another one does, or the firmware has another version.
    """
    heard = _Heard()
    end_s = line_s() + patience_s
    said_s = -_AGAIN_S
    while (now_s := line_s()) < end_s:
        if now_s >= said_s + _AGAIN_S or said_s < 0.0:
            port.write(b"\0" + encode(Hello(session)))  # the zero ends any partial frame
            said_s = now_s
        port.wait(min(end_s, said_s + _AGAIN_S) - now_s)
        data = port.read()
        if len(heard.data) < _SHOWN:
            heard.data += data[:_SHOWN]
        messages = frames.feed(data)
        for i, message in enumerate(messages):
            if isinstance(message, Telemetry):
                heard.telemetry += 1
            elif isinstance(message, Ident):
                _check_version(port, message)
                if message.session == session:
                    return message, [one for one in messages[i + 1 :] if isinstance(one, Telemetry | Answer)]
            elif isinstance(message, Answer) and message.to == TYPE_OF[Hello]:
                _check_answer(port, message)
    raise _nobody(port, heard, patience_s)


def _check_version(port: BytePort, ident: Ident) -> None:
    if ident.protocol != PROTOCOL:
        firmware = ".".join(map(str, ident.firmware))
        raise DeviceError(
            f"{port.name}: firmware {firmware} of '{ident.name}' speaks protocol {ident.protocol}, "
            f"this program protocol {PROTOCOL}.",
            fix=FLASH,
        )


def _check_answer(port: BytePort, answer: Answer) -> None:
    if answer.result == Result.OTHER_PROTOCOL:
        raise DeviceError(
            f"{port.name}: the firmware there speaks another protocol than this program's, which is {PROTOCOL}.",
            fix=FLASH,
        )


def _nobody(port: BytePort, heard: _Heard, patience_s: float) -> DeviceError:
    """Return the error for a missing answer, chosen by the received bytes."""
    within = f"{port.name}: no answer to the greeting in {patience_s:g} s"
    if not heard.data:
        return DeviceError(
            f"{within}; not one byte came.",
            fix=f"is it the board's port, does the board's light shine? If so, {FLASH}",
        )
    seen = in_hex(heard.data)
    if heard.telemetry:
        return DeviceError(
            f"{within}, though its telemetry comes ({seen}).", fix="what is sent does not arrive: look at the wire TX."
        )
    text = heard.data.decode("ascii", "replace")
    if sum(one.isprintable() or one in "\r\n\t" for one in text) >= 0.9 * len(text):  # exact: integers
        shown = text[:_SHOWN].encode("unicode_escape").decode()
        return DeviceError(
            f"{within}. Another device is there; it says '{shown}' ({seen}).",
            fix="take the port of the microcontroller: `snr doctor` lists them.",
        )
    return DeviceError(
        f"{within}. What came ({seen}) is none of its frames.",
        fix=f"wrong baud rate, or another device; if it is the microcontroller, {FLASH}",
    )


def in_hex(data: bytes) -> str:
    """Return the first bytes as hexadecimal text for a message.

    >>> in_hex(b"$GP")
    '24 47 50'
    """
    return data[:_SHOWN].hex(" ") + (" ..." if len(data) > _SHOWN else "")
