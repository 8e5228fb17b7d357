"""Commands of a Pololu Maestro servo controller, and decoding of its answers. Bytes only.

Its compact protocol: a command byte with the highest bit set, then data bytes without it; 14-bit numbers as two groups
of seven bits, low one first. Targets and positions count quarters of a microsecond. With "Enable CRC" in its settings
each command ends with a CRC-7; answers never have one.

Source: Pololu Maestro Servo Controller User's Guide, sections 4.c (errors), 5.c to 5.e (protocol, CRC, commands).
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntFlag

QUARTERS_PER_US = 4
ANSWER_BYTES = 2  # a number, low byte first
MAX_SINGLE_TARGETS = 6  # the Micro Maestro, with six channels, lacks Set Multiple Targets
_CRC7_REVERSED = 0x91  # polynomial x^7 + x^3 + 1, lowest bit first

_SET_TARGET, _SET_TARGETS, _GET_POSITION = 0x84, 0x9F, 0x90
GET_ERRORS = b"\xa1"  # asks for the error register, which clears it


class MaestroError(IntFlag):
    """Bits of its error register. Each of them, when set, sends all channels to their home positions."""

    SIGNAL = 1 << 0
    OVERRUN = 1 << 1
    BUFFER_FULL = 1 << 2
    CRC = 1 << 3
    PROTOCOL = 1 << 4
    TIMEOUT = 1 << 5
    SCRIPT_STACK = 1 << 6
    SCRIPT_CALL_STACK = 1 << 7
    SCRIPT_COUNTER = 1 << 8


MEANINGS = {
    MaestroError.SIGNAL: "a byte without its stop bit: another baud rate?",
    MaestroError.OVERRUN: "bytes came faster than it could take them",
    MaestroError.BUFFER_FULL: "its buffer ran over",
    MaestroError.CRC: "a command with a wrong CRC, or without one: is 'Enable CRC' on in its settings, and here not?",
    MaestroError.PROTOCOL: "bytes that are not a command: check 'Enable CRC', and close other programs on the port",
    MaestroError.TIMEOUT: "no command came for its serial timeout",
    MaestroError.SCRIPT_STACK: "its script's stack",
    MaestroError.SCRIPT_CALL_STACK: "its script's call stack",
    MaestroError.SCRIPT_COUNTER: "its script left its program",
}


def crc7(data: bytes) -> int:
    """Return the CRC that a Maestro expects after a command.

    >>> hex(crc7(bytes([0x83, 0x01])))
    '0x17'
    """
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc ^ _CRC7_REVERSED) >> 1 if crc & 1 else crc >> 1
    return crc


def set_target(channel: int, pulse_us: float) -> bytes:
    """Return the command for one channel.

    >>> set_target(0, 1500.0).hex(" ")
    '84 00 70 2e'
    """
    return bytes([_SET_TARGET, channel]) + _number(round(pulse_us * QUARTERS_PER_US))


def set_targets(pulses_us: Sequence[float]) -> list[bytes]:
    """Return the commands for channels 0 to n - 1: one for all, or one for each if it may be the six-channel board.

    >>> [len(command) for command in set_targets([1500.0] * 8)], len(set_targets([1500.0] * 6))
    ([19], 6)
    """
    if len(pulses_us) <= MAX_SINGLE_TARGETS:
        return [set_target(channel, pulse) for channel, pulse in enumerate(pulses_us)]
    numbers = b"".join([_number(round(pulse * QUARTERS_PER_US)) for pulse in pulses_us])
    return [bytes([_SET_TARGETS, len(pulses_us), 0]) + numbers]


def get_position(channel: int) -> bytes:
    """Return the query for the pulse of a channel."""
    return bytes([_GET_POSITION, channel])


def describe_errors(errors: int) -> str:
    """Return the bits that are set in an error register as text."""
    known = [f"{bit.name}: {MEANINGS[bit]}" for bit in MaestroError if errors & bit]
    return "; ".join(known) or "none"


def _number(value: int) -> bytes:
    return bytes([value & 0x7F, value >> 7 & 0x7F])
