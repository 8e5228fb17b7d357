"""Messages of the microcontroller's serial line as bytes, and back.

    message --> type, fields, CRC --> COBS --> a zero            (docs/formats.md, section 8, says every byte)

Owns no port: converts messages to bytes, and bytes to messages.
"""

from __future__ import annotations

import struct
from math import isfinite

from snr_sim.devices.wire.framing import FrameReader, framed
from snr_sim.devices.wire.mcu_messages import (
    TYPE_OF,
    Answer,
    Arm,
    ClearStop,
    Disarm,
    EmergencyStop,
    Fault,
    FromMcu,
    Hello,
    Ident,
    ResetCause,
    Result,
    SetWidths,
    State,
    Telemetry,
    ToMcu,
)
from snr_sim.prelude.errors import CommandError

MOST_CHANNELS = 16
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
_STATES = frozenset(map(int, State))
_RESULTS = frozenset(map(int, Result))
_WIDTHS = [struct.Struct(f"<{n}H") for n in range(MOST_CHANNELS + 1)]


def encode(message: ToMcu | FromMcu) -> bytes:
    """Return a message as the bytes of its frame, with the zero that ends it.

    Raises:
        CommandError: a value is not a finite number or does not fit, or there are more than 16 widths.

    >>> encode(Arm(session=1)).hex(" ")
    '03 03 01 03 6a 61 00'
    """
    try:
        body = _packed(message)
    except (struct.error, TypeError) as error:
        raise CommandError(
            f"This does not fit into a frame: {message}.", fix="numbers as docs/formats.md says."
        ) from error
    return framed(body)


def _packed(message: ToMcu | FromMcu) -> bytes:
    kind = TYPE_OF[type(message)]
    if isinstance(message, SetWidths):
        m = message
        head = _SET.pack(kind, m.session, m.seq, m.stamp_ms & 0xFFFFFFFF, m.age_ms, m.lease_ms)
        return head + _packed_widths(m.widths_us)
    if isinstance(message, Hello):
        return _HELLO.pack(kind, message.session, message.protocol)
    if isinstance(message, Telemetry):
        t = message
        head = _TELEMETRY.pack(
            kind, t.nth, t.session, t.seq, t.uptime_ms, t.state, t.faults, t.reset_cause,
            t.command_age_ms, t.crc_errors, t.battery_pin_mv, t.current_pin_mv,
        )  # fmt: skip
        return head + _packed_widths(t.widths_us)
    if isinstance(message, Answer):
        return _ANSWER.pack(kind, message.nth, message.session, message.to, message.result)
    if isinstance(message, Ident):
        return _packed_ident(kind, message)
    return _SESSION.pack(kind, message.session)


def _packed_widths(widths_us: tuple[float, ...]) -> bytes:
    if len(widths_us) > MOST_CHANNELS:
        raise CommandError(f"{len(widths_us)} widths in one frame.", fix=f"at most {MOST_CHANNELS}.")
    for width_us in widths_us:
        if not isfinite(width_us):
            raise CommandError(f"A width of {width_us} us.", fix="a finite number.")
    return _WIDTHS[len(widths_us)].pack(*[round(width_us * _STEPS_PER_US) for width_us in widths_us])


def _packed_ident(kind: int, i: Ident) -> bytes:
    widths = (round(us * _STEPS_PER_US) for us in (i.lowest_us, i.neutral_us, i.highest_us, i.dead_band_us))
    rest = (i.resolution_ns, i.period_us, i.most_lease_ms, i.esc_start_ms, i.slew_us_per_100ms, i.dwell_ms)
    return _IDENT.pack(
        kind, i.nth, i.session, i.protocol, *i.firmware, i.channels, *widths, *rest,
        i.mcu.encode("ascii", "replace"), i.name.encode("ascii", "replace"),
    )  # fmt: skip


class McuFrames:
    """Decoder from bytes to messages, for chunks of any size with other bytes among them. Never raises, never grows.

    Attributes:
        crc_errors: frames that were damaged: invalid COBS, or a wrong check sum.
        not_ours: intact frames of a type or length that is unknown here.
        overlong: runs of bytes without a zero, longer than any frame: another baud rate, another device.
        gaps: frames of the microcontroller that were lost, by their count.
        frames: messages decoded.
    """

    def __init__(self) -> None:
        self.not_ours = self.gaps = self.frames = 0
        self._reader = FrameReader(MAX_FRAME_BYTES)
        self._next_nth: int | None = None

    @property
    def crc_errors(self) -> int:
        """See above."""
        return self._reader.crc_errors

    @property
    def overlong(self) -> int:
        """See above."""
        return self._reader.overlong

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
            message = _unpacked(body)
            if message is None:
                self.not_ours += 1
                continue
            self.frames += 1
            if isinstance(message, (Telemetry, Answer, Ident)):
                self._count(message.nth)
            messages.append(message)
        return messages

    def _count(self, nth: int) -> None:
        if self._next_nth is not None:
            self.gaps += (nth - self._next_nth) % 256
        self._next_nth = (nth + 1) % 256


def _unpacked(body: bytes) -> ToMcu | FromMcu | None:
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
    if kind == TYPE_OF[Answer] and size == _ANSWER.size:
        _, nth, session, to, result = _ANSWER.unpack(body)
        return Answer(nth, session, to, Result(result)) if result in _RESULTS else None
    if kind == TYPE_OF[Ident] and size == _IDENT.size:
        return _ident(body)
    if kind in _PLAIN and size == _SESSION.size:
        return _PLAIN[kind](_SESSION.unpack(body)[1])
    return None


def _telemetry(body: bytes) -> Telemetry | None:
    widths_us = _widths(body[_TELEMETRY.size :])
    _, nth, session, seq, up_ms, state, faults, cause, age_ms, errors, volts, amps = _TELEMETRY.unpack_from(body)
    if widths_us is None or state not in _STATES:
        return None
    known = State(state), Fault(faults), ResetCause(cause)
    return Telemetry(nth, session, seq, up_ms, *known, age_ms, errors, volts, amps, widths_us)


def _ident(body: bytes) -> Ident:
    _, nth, session, protocol, major, minor, channels, *numbers, mcu, name = _IDENT.unpack(body)
    lowest, neutral, highest, dead_band = (steps / _STEPS_PER_US for steps in numbers[:4])
    resolution_ns, period_us, most_lease_ms, esc_start_ms, slew, dwell_ms = numbers[4:]
    return Ident(
        nth, session, protocol, (major, minor), channels, lowest, neutral, highest, dead_band, resolution_ns,
        period_us, most_lease_ms, esc_start_ms, slew, dwell_ms, _text(mcu), _text(name),
    )  # fmt: skip


def _text(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode("ascii", "replace")


def _widths(packed: bytes) -> tuple[float, ...] | None:
    n, odd = divmod(len(packed), 2)
    if odd or n > MOST_CHANNELS:
        return None
    return tuple([steps / _STEPS_PER_US for steps in _WIDTHS[n].unpack(packed)])
