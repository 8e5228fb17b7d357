"""Messages of the microcontroller's line: as documented, in chunks of any size, and among garbage."""

import math
from binascii import crc_hqx
from typing import Any

import pytest
from cobs import cobs as peer
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.wire.mcu_frames import MAX_FRAME_BYTES, McuFrames, encode
from snr_sim.devices.wire.mcu_messages import (
    TYPE_OF,
    AckResult,
    Arm,
    ClearStop,
    CommandAck,
    Disarm,
    EmergencyStop,
    Hello,
    Ident,
    McuFault,
    McuState,
    ResetCause,
    SetWidths,
    Telemetry,
)
from snr_sim.prelude.errors import CommandError

U8, U16, U32 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32))
WIDTH_US = U16.map(lambda steps: steps / 2)
WIDTHS_US = st.lists(WIDTH_US, max_size=16).map(tuple)
NAME = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=12)
MESSAGE = st.one_of(
    st.builds(Hello, U16, U8),
    st.builds(SetWidths, U16, U16, U32, U16, U16, WIDTHS_US),
    *[st.builds(kind, U16) for kind in (Arm, Disarm, EmergencyStop, ClearStop)],
    st.builds(CommandAck, U8, U16, U8, st.sampled_from(AckResult)),
    st.builds(
        Telemetry, U8, U16, U16, U32, st.sampled_from(McuState), U16.map(McuFault), U8.map(ResetCause),
        U16, U16, U16, U16, WIDTHS_US,
    ),
    st.builds(
        Ident, U8, U16, U8, st.tuples(U8, U8), U8, *[WIDTH_US] * 4, *[U16] * 6, NAME, NAME,
    ),
)  # fmt: skip


def frame(body: bytes) -> bytes:
    """Return a frame made without our code."""
    return peer.encode(body + crc_hqx(body, 0).to_bytes(2, "big")) + b"\0"


@given(MESSAGE)
def test_mcu_frames_round_trip_keeps_message(message: Any) -> None:
    encoded = encode(message)
    assert encoded.index(0) == len(encoded) - 1 <= MAX_FRAME_BYTES
    assert McuFrames().feed(encoded) == [message]


@pytest.mark.parametrize(
    ("message", "body"),
    [
        (Hello(0x1234), "01 34 12 01"),
        (SetWidths(0x1234, 7, 1000, 5, 200, (1500.0, 1100.5)), "02 34 12 07 00 e8 03 00 00 05 00 c8 00 b8 0b 99 08"),
        (Arm(0x1234), "03 34 12"),
        (Disarm(0x1234), "04 34 12"),
        (EmergencyStop(), "05 00 00"),
        (ClearStop(0x1234), "06 34 12"),
        (CommandAck(9, 0x1234, TYPE_OF[Arm], AckResult.NOT_NEUTRAL), "83 09 34 12 03 03"),
        (
            Telemetry(
                8, 0x1234, 7, 70000, McuState.ARMED, McuFault.CLAMPED | McuFault.OVERRUN, ResetCause.WATCHDOG,
                12, 3, 1450, 330, (1500.0, 1100.5),
            ),
            "82 08 34 12 07 00 70 11 01 00 02 10 01 08 0c 00 03 00 aa 05 4a 01 b8 0b 99 08",
        ),
    ],
)  # fmt: skip
def test_mcu_frames_bytes_equal_formats_page(message: Any, body: str) -> None:
    assert encode(message) == frame(bytes.fromhex(body))


@given(st.lists(MESSAGE, max_size=6), st.lists(st.integers(1, 40), min_size=1))
def test_mcu_frames_chunk_size_changes_nothing(messages: list[Any], cuts: list[int]) -> None:
    stream, frames, read, at = b"".join(map(encode, messages)), McuFrames(), [], 0
    while at < len(stream):
        size = cuts[at % len(cuts)]
        read += frames.feed(stream[at : at + size])
        at += size
    assert read == messages
    assert (frames.crc_errors, frames.unknown_frames, frames.oversized, frames.frames) == (0, 0, 0, len(messages))


@given(st.lists(st.binary(max_size=400), max_size=8), MESSAGE)
def test_mcu_frames_after_any_garbage_reads_next_frame(garbage: list[bytes], message: Any) -> None:
    frames = McuFrames()
    for piece in garbage:
        frames.feed(piece)
    assert frames.feed(b"\0" + encode(message))[-1:] == [message]


@given(MESSAGE, st.data())
def test_mcu_frames_flipped_bit_is_rejected(message: Any, data: st.DataObject) -> None:
    damaged = bytearray(encode(message))
    damaged[data.draw(st.integers(0, len(damaged) - 2))] ^= 1 << data.draw(st.integers(0, 7))
    frames = McuFrames()
    assert frames.feed(bytes(damaged)) == []


def test_mcu_frames_endless_run_is_dropped() -> None:
    frames = McuFrames()
    for _ in range(1000):
        assert frames.feed(b"\x55" * 1000) == []
    assert frames.oversized == 1
    assert frames.feed(b"\0" + encode(Arm(1))) == [Arm(1)]


def test_mcu_frames_counts_lost_frames() -> None:
    frames = McuFrames()
    for frame_count in (254, 255, 0, 3, 4):
        frames.feed(encode(CommandAck(frame_count, 1, 3, AckResult.DONE)))
    assert frames.gaps == 2


@pytest.mark.parametrize(
    "body", ["7f 01 02", "82 00", "03 01", "83 00 01 00 03 63", "02 34 12 07 00 e8 03 00 00 05 00 c8 00 b8"]
)
def test_mcu_frames_intact_unknown_frame_is_counted(body: str) -> None:
    frames = McuFrames()
    assert frames.feed(frame(bytes.fromhex(body))) == []
    assert (frames.unknown_frames, frames.crc_errors) == (1, 0)


@pytest.mark.parametrize("width", [math.nan, math.inf, -math.inf, None, "1500", -1.0, 40_000.0])
def test_h6_encode_non_finite_width_raises_command_error(width: Any) -> None:
    with pytest.raises(CommandError):
        encode(SetWidths(1, 1, 0, 0, 200, (1500.0, width)))


def test_encode_too_many_widths_raises_command_error() -> None:
    with pytest.raises(CommandError, match="17 widths"):
        encode(SetWidths(1, 1, 0, 0, 200, (1500.0,) * 17))


def test_encode_stamp_wraps_at_32_bits() -> None:
    [message] = McuFrames().feed(encode(SetWidths(1, 1, 2**32 + 5, 0, 200, ())))
    assert isinstance(message, SetWidths)
    assert message.stamp_ms == 5
