"""Messages of the microcontroller's serial line as bytes, and back.

    message --> type, fields, CRC --> COBS --> a zero            (docs/formats.md, section 8, says every byte)

Owns no port: converts messages to bytes, and bytes to messages.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec

from snr_sim.devices.wire import cobs
from snr_sim.devices.wire import mcu_messages as mcu
from snr_sim.prelude.errors import CommandError

MAX_CHANNELS = 16
MAX_FRAME_BYTES = 96  # between two zeros; the longest have 60
_STEPS_PER_US = 2  # a width on the wire counts half microseconds
_CRC_BYTES = 2


class _Field(NamedTuple):
    """Bytes of one field: its format in `struct`, and the conversions to and from the packed value."""

    code: str
    pack: Callable[[Any], Any] = lambda value: value
    unpack: Callable[[Any], Any] = lambda packed: packed


def _steps(width_us: float) -> int:
    return round(width_us * _STEPS_PER_US)


def _width_us(steps: int) -> float:
    return steps / _STEPS_PER_US


def _name(size: int) -> _Field:
    """Return the field of a text in ASCII, filled up with zeros."""
    return _Field(
        f"{size}s",
        lambda text: text.encode("ascii", "replace"),
        lambda packed: packed.split(b"\0", 1)[0].decode("ascii", "replace"),
    )


_U8, _U16, _U32 = _Field("B"), _Field("H"), _Field("I", lambda value: value & 0xFFFFFFFF)
_WIDTH, _VERSION = _Field("H", _steps, _width_us), _Field("2s", bytes, tuple)
# After the type. Those of _HAS_WIDTHS end with a width for each channel.
_FIELDS: dict[type[Any], tuple[_Field, ...]] = {
    mcu.Hello: (_U16, _U8),
    mcu.SetWidths: (_U16, _U16, _U32, _U16, _U16),
    mcu.Arm: (_U16,),
    mcu.Disarm: (_U16,),
    mcu.EmergencyStop: (_U16,),
    mcu.ClearStop: (_U16,),
    mcu.Ident: (_U8, _U16, _U8, _VERSION, _U8, *[_WIDTH] * 4, *[_U16] * 6, _name(12), _name(16)),
    mcu.Telemetry: (
        *(_U8, _U16, _U16, _U32),
        *(_Field("B", unpack=mcu.McuState), _Field("H", unpack=mcu.McuFault), _Field("B", unpack=mcu.ResetCause)),
        *[_U16] * 4,
    ),
    mcu.CommandAck: (_U8, _U16, _U8, _Field("B", unpack=mcu.AckResult)),
}
_HAS_WIDTHS = (mcu.SetWidths, mcu.Telemetry)
_STRUCTS = {kind: struct.Struct("<B" + "".join(one.code for one in fields)) for kind, fields in _FIELDS.items()}
_KINDS = {number: kind for kind, number in mcu.TYPE_OF.items()}


def encode(message: mcu.ToMcu | mcu.FromMcu) -> bytes:
    """Return a message as the bytes of its frame, with the zero that ends it.

    Raises:
        CommandError: a value is not a finite number or does not fit, or there are more than 16 widths.

    >>> encode(mcu.Arm(session=1)).hex(" ")
    '03 03 01 03 6a 61 00'
    """
    try:
        body = _pack(message)
    except (struct.error, TypeError, ValueError, OverflowError) as error:  # the last two: a width that is not finite
        raise CommandError(
            f"This message does not fit into a frame: {message}.", fix="docs/formats.md has the range of each field."
        ) from error
    return cobs.encode(body + crc_hqx(body, 0).to_bytes(_CRC_BYTES, "big")) + b"\0"


def _pack(message: mcu.ToMcu | mcu.FromMcu) -> bytes:
    kind = type(message)
    values = list(msgspec.structs.astuple(message))
    widths_us = values.pop() if kind in _HAS_WIDTHS else ()
    if len(widths_us) > MAX_CHANNELS:
        raise CommandError(f"{len(widths_us)} widths are too many for one frame.", fix=f"send at most {MAX_CHANNELS}.")
    packed = [field.pack(value) for field, value in zip(_FIELDS[kind], values, strict=True)]
    return _STRUCTS[kind].pack(mcu.TYPE_OF[kind], *packed) + struct.pack(f"<{len(widths_us)}H", *map(_steps, widths_us))


class McuFrames:
    """Decoder from bytes to messages, for chunks of any size with other bytes among them. Never raises, never grows.

    Attributes:
        crc_errors: frames that were damaged: invalid COBS, or a wrong check sum.
        unknown_frames: intact frames of a type or length that is unknown here.
        oversized: runs of bytes without a zero, longer than any frame: another baud rate, another device.
        gaps: frames of the microcontroller that were lost, by their count.
        frames: messages decoded.
        received_bytes: in all.
    """

    def __init__(self) -> None:
        self.crc_errors: int = 0
        self.unknown_frames: int = 0
        self.oversized: int = 0
        self.gaps: int = 0
        self.frames: int = 0
        self.received_bytes: int = 0
        self.resync()

    def resync(self) -> None:
        """Forget a partial frame and the count of frames: another stream starts."""
        self._rest = bytearray()
        self._is_skipping = False  # inside an oversized run
        self._next_count: int | None = None

    def feed(self, data: bytes) -> list[mcu.ToMcu | mcu.FromMcu]:
        """Add received bytes; return the messages that are complete.

        >>> frames = McuFrames()
        >>> frames.feed(bytes.fromhex("99 99 00 03 03 01 03 6a")), frames.feed(bytes.fromhex("61 00"))
        ([], [Arm(session=1)])
        >>> frames.crc_errors
        1
        """
        messages: list[mcu.ToMcu | mcu.FromMcu] = []
        self.received_bytes += len(data)
        *ends, rest = data.split(b"\0")
        for end in ends:
            self._add(end)
            message = self._end_frame()
            if message is not None:
                messages.append(message)
        self._add(rest)
        return messages

    def _add(self, piece: bytes) -> None:
        if self._is_skipping:
            return
        self._rest += piece[: MAX_FRAME_BYTES + 1]
        if len(self._rest) > MAX_FRAME_BYTES:
            self._rest.clear()
            self._is_skipping = True
            self.oversized += 1

    def _end_frame(self) -> mcu.ToMcu | mcu.FromMcu | None:
        encoded, self._is_skipping = bytes(self._rest), False
        self._rest.clear()
        if not encoded:
            return None
        try:
            checked = cobs.decode(encoded)
        except cobs.CobsError:
            checked = b""
        # The CRC over a body and its own CRC is zero.
        if len(checked) <= _CRC_BYTES or crc_hqx(checked, 0) != 0:
            self.crc_errors += 1
            return None
        message = _unpack(checked[:-_CRC_BYTES])
        if message is None:
            self.unknown_frames += 1
            return None
        self.frames += 1
        if isinstance(message, (mcu.Telemetry, mcu.CommandAck, mcu.Ident)):
            if self._next_count is not None:
                self.gaps += (message.frame_count - self._next_count) % 256
            self._next_count = (message.frame_count + 1) % 256
        return message


def _unpack(body: bytes) -> mcu.ToMcu | mcu.FromMcu | None:
    """Return the message in a frame without its check sum; None if its type, length or a value is unknown."""
    kind = _KINDS.get(body[0])
    if kind is None:
        return None
    head, has_widths = _STRUCTS[kind], kind in _HAS_WIDTHS
    width_bytes = len(body) - head.size
    if width_bytes not in range(0, 2 * MAX_CHANNELS + 1 if has_widths else 1, 2):
        return None
    packed = head.unpack_from(body)[1:]
    try:
        values = [field.unpack(value) for field, value in zip(_FIELDS[kind], packed, strict=True)]
    except ValueError:  # of a state or a result
        return None
    if has_widths:
        values.append(tuple(map(_width_us, struct.unpack_from(f"<{width_bytes // 2}H", body, head.size))))
    message: mcu.ToMcu | mcu.FromMcu = kind(*values)
    return message
