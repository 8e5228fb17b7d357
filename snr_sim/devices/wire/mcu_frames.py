"""Messages of the microcontroller's serial line as bytes, and back.

    message --> type, fields, CRC --> COBS --> a zero            (docs/formats.md, section 8, says every byte)

Owns no port: converts messages to bytes, and bytes to messages.
"""

from __future__ import annotations

import struct
from math import isfinite

from snr_sim.devices.wire.framing import CobsFrameReader, encode_frame
from snr_sim.devices.wire.mcu_messages import (
    TYPE_OF,
    AckResult,
    Arm,
    ClearStop,
    CommandAck,
    Disarm,
    EmergencyStop,
    FromMcu,
    Hello,
    Ident,
    McuFault,
    McuState,
    ResetCause,
    SetWidths,
    Telemetry,
    ToMcu,
)
from snr_sim.prelude.errors import CommandError

MAX_CHANNELS = 16
MAX_FRAME_BYTES = 96  # between two zeros; the longest have 60
_STEPS_PER_US = 2  # a width on the wire counts half microseconds

_PLAIN: dict[int, type[Arm | Disarm | EmergencyStop | ClearStop]] = {
    TYPE_OF[kind]: kind for kind in (Arm, Disarm, EmergencyStop, ClearStop)
}
_HELLO = struct.Struct("<BHB")
_SET = struct.Struct("<BHHIHH")
_SESSION = struct.Struct("<BH")
_IDENT = struct.Struct("<BBHBBBB10H12s16s")
_TELEMETRY = struct.Struct("<BBHHIBHBHHHH")
_ANSWER = struct.Struct("<BBHBB")
_STATES = frozenset(map(int, McuState))
_RESULTS = frozenset(map(int, AckResult))
_WIDTHS = [struct.Struct(f"<{n}H") for n in range(MAX_CHANNELS + 1)]


def encode(message: ToMcu | FromMcu) -> bytes:
    """Return a message as the bytes of its frame, with the zero that ends it.

    Raises:
        CommandError: a value is not a finite number or does not fit, or there are more than 16 widths.

    >>> encode(Arm(session=1)).hex(" ")
    '03 03 01 03 6a 61 00'
    """
    try:
        body = _pack(message)
    except (struct.error, TypeError) as error:
        raise CommandError(
            f"This message does not fit into a frame: {message}.", fix="docs/formats.md has the range of each field."
        ) from error
    return encode_frame(body)


def _pack(message: ToMcu | FromMcu) -> bytes:
    kind = TYPE_OF[type(message)]
    if isinstance(message, SetWidths):
        m = message
        head = _SET.pack(kind, m.session, m.seq, m.stamp_ms & 0xFFFFFFFF, m.age_ms, m.lease_ms)
        return head + _pack_widths(m.widths_us)
    if isinstance(message, Hello):
        return _HELLO.pack(kind, message.session, message.protocol)
    if isinstance(message, Telemetry):
        t = message
        head = _TELEMETRY.pack(
            kind, t.frame_count, t.session, t.seq, t.uptime_ms, t.state, t.faults, t.reset_cause,
            t.command_age_ms, t.crc_errors, t.battery_pin_mv, t.current_pin_mv,
        )  # fmt: skip
        return head + _pack_widths(t.widths_us)
    if isinstance(message, CommandAck):
        return _ANSWER.pack(kind, message.frame_count, message.session, message.to, message.result)
    if isinstance(message, Ident):
        return _pack_ident(kind, message)
    return _SESSION.pack(kind, message.session)


def _pack_widths(widths_us: tuple[float, ...]) -> bytes:
    if len(widths_us) > MAX_CHANNELS:
        raise CommandError(f"{len(widths_us)} widths are too many for one frame.", fix=f"send at most {MAX_CHANNELS}.")
    for width_us in widths_us:
        if not isfinite(width_us):
            raise CommandError(f"A width must be finite, not {width_us} us.", fix="send a finite number.")
    return _WIDTHS[len(widths_us)].pack(*[round(width_us * _STEPS_PER_US) for width_us in widths_us])


def _pack_ident(kind: int, i: Ident) -> bytes:
    widths = (round(us * _STEPS_PER_US) for us in (i.lowest_us, i.neutral_us, i.highest_us, i.dead_band_us))
    rest = (i.resolution_ns, i.period_us, i.max_lease_ms, i.esc_start_ms, i.slew_us_per_100ms, i.dwell_ms)
    return _IDENT.pack(
        kind, i.frame_count, i.session, i.protocol, *i.firmware, i.channels, *widths, *rest,
        i.mcu.encode("ascii", "replace"), i.name.encode("ascii", "replace"),
    )  # fmt: skip


class McuFrames:
    """Decoder from bytes to messages, for chunks of any size with other bytes among them. Never raises, never grows.

    Attributes:
        crc_errors: frames that were damaged: invalid COBS, or a wrong check sum.
        unknown_frames: intact frames of a type or length that is unknown here.
        oversized: runs of bytes without a zero, longer than any frame: another baud rate, another device.
        gaps: frames of the microcontroller that were lost, by their count.
        frames: messages decoded.
    """

    def __init__(self) -> None:
        self.unknown_frames = self.gaps = self.frames = 0
        self._reader = CobsFrameReader(MAX_FRAME_BYTES)
        self._next_count: int | None = None

    @property
    def crc_errors(self) -> int:
        """See above."""
        return self._reader.crc_errors

    @property
    def oversized(self) -> int:
        """See above."""
        return self._reader.oversized

    def feed(self, data: bytes) -> list[ToMcu | FromMcu]:
        """Add received bytes; return the messages that are complete.

        >>> frames = McuFrames()
        >>> frames.feed(bytes.fromhex("99 99 00 03 03 01 03 6a")), frames.feed(bytes.fromhex("61 00"))
        ([], [Arm(session=1)])
        >>> frames.crc_errors
        1
        """
        messages: list[ToMcu | FromMcu] = []
        for body in self._reader.feed(data):
            message = _unpack(body)
            if message is None:
                self.unknown_frames += 1
                continue
            self.frames += 1
            if isinstance(message, (Telemetry, CommandAck, Ident)):
                self._count(message.frame_count)
            messages.append(message)
        return messages

    def _count(self, frame_count: int) -> None:
        if self._next_count is not None:
            self.gaps += (frame_count - self._next_count) % 256
        self._next_count = (frame_count + 1) % 256


def _unpack(body: bytes) -> ToMcu | FromMcu | None:
    """Return the message in a frame without its check sum; None if its type is unknown."""
    kind, size = body[0], len(body)
    if kind == TYPE_OF[Telemetry] and size >= _TELEMETRY.size:
        return _telemetry(body)
    if kind == TYPE_OF[SetWidths] and size >= _SET.size:
        widths_us = _widths(body[_SET.size :])
        _, session, seq, stamp_ms, age_ms, lease_ms = _SET.unpack_from(body)
        return None if widths_us is None else SetWidths(session, seq, stamp_ms, age_ms, lease_ms, widths_us)
    if kind == TYPE_OF[Hello] and size == _HELLO.size:
        return Hello(*_HELLO.unpack(body)[1:])
    if kind == TYPE_OF[CommandAck] and size == _ANSWER.size:
        _, frame_count, session, to, result = _ANSWER.unpack(body)
        return CommandAck(frame_count, session, to, AckResult(result)) if result in _RESULTS else None
    if kind == TYPE_OF[Ident] and size == _IDENT.size:
        return _ident(body)
    if kind in _PLAIN and size == _SESSION.size:
        return _PLAIN[kind](_SESSION.unpack(body)[1])
    return None


def _telemetry(body: bytes) -> Telemetry | None:
    widths_us = _widths(body[_TELEMETRY.size :])
    _, frame_count, session, seq, up_ms, state, faults, cause, age_ms, errors, volts, amps = _TELEMETRY.unpack_from(
        body
    )
    if widths_us is None or state not in _STATES:
        return None
    known = McuState(state), McuFault(faults), ResetCause(cause)
    return Telemetry(frame_count, session, seq, up_ms, *known, age_ms, errors, volts, amps, widths_us)


def _ident(body: bytes) -> Ident:
    _, frame_count, session, protocol, major, minor, channels, *numbers, mcu, name = _IDENT.unpack(body)
    lowest, neutral, highest, dead_band = (steps / _STEPS_PER_US for steps in numbers[:4])
    resolution_ns, period_us, max_lease_ms, esc_start_ms, slew, dwell_ms = numbers[4:]
    return Ident(
        frame_count, session, protocol, (major, minor), channels, lowest, neutral, highest, dead_band, resolution_ns,
        period_us, max_lease_ms, esc_start_ms, slew, dwell_ms, _text(mcu), _text(name),
    )  # fmt: skip


def _text(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode("ascii", "replace")


def _widths(packed: bytes) -> tuple[float, ...] | None:
    n, odd = divmod(len(packed), 2)
    if odd or n > MAX_CHANNELS:
        return None
    return tuple([steps / _STEPS_PER_US for steps in _WIDTHS[n].unpack(packed)])
