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
    Answer,
    Arm,
    ClearStop,
    Disarm,
    EmergencyStop,
    Fault,
    Hello,
    Ident,
    ResetCause,
    Result,
    SetWidths,
    State,
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
    st.builds(Answer, U8, U16, U8, st.sampled_from(Result)),
    st.builds(
        Telemetry, U8, U16, U16, U32, st.sampled_from(State), U16.map(Fault), U8.map(ResetCause),
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
def test_every_message_comes_back(message: Any) -> None:
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
        (Answer(9, 0x1234, TYPE_OF[Arm], Result.NOT_NEUTRAL), "83 09 34 12 03 03"),
        (
            Telemetry(
                8, 0x1234, 7, 70000, State.ARMED, Fault.CLAMPED | Fault.OVERRUN, ResetCause.WATCHDOG,
                12, 3, 1450, 330, (1500.0, 1100.5),
            ),
            "82 08 34 12 07 00 70 11 01 00 02 10 01 08 0c 00 03 00 aa 05 4a 01 b8 0b 99 08",
        ),
    ],
)  # fmt: skip
def test_messages_are_the_bytes_that_the_page_of_formats_says(message: Any, body: str) -> None:
    assert encode(message) == frame(bytes.fromhex(body))


@given(st.lists(MESSAGE, max_size=6), st.lists(st.integers(1, 40), min_size=1))
def test_it_does_not_matter_how_the_bytes_are_cut(messages: list[Any], cuts: list[int]) -> None:
    stream, frames, read, at = b"".join(map(encode, messages)), McuFrames(), [], 0
    while at < len(stream):
        size = cuts[at % len(cuts)]
        read += frames.feed(stream[at : at + size])
        at += size
    assert read == messages
    assert (frames.crc_errors, frames.not_ours, frames.overlong, frames.frames) == (0, 0, 0, len(messages))


@given(st.lists(st.binary(max_size=400), max_size=8), MESSAGE)
def test_after_any_garbage_the_next_frame_is_read(garbage: list[bytes], message: Any) -> None:
    frames = McuFrames()
    for piece in garbage:
        frames.feed(piece)
    assert frames.feed(b"\0" + encode(message))[-1:] == [message]


@given(MESSAGE, st.data())
def test_a_frame_with_a_flipped_bit_is_not_read(message: Any, data: st.DataObject) -> None:
    damaged = bytearray(encode(message))
    damaged[data.draw(st.integers(0, len(damaged) - 2))] ^= 1 << data.draw(st.integers(0, 7))
    frames = McuFrames()
    assert frames.feed(bytes(damaged)) == []


def test_what_has_no_end_is_not_kept() -> None:
    frames = McuFrames()
    for _ in range(1000):
        assert frames.feed(b"\x55" * 1000) == []
    assert frames.overlong == 1
    assert frames.feed(b"\0" + encode(Arm(1))) == [Arm(1)]


def test_frames_of_the_microcontroller_that_never_came_are_counted() -> None:
    frames = McuFrames()
    for nth in (254, 255, 0, 3, 4):
        frames.feed(encode(Answer(nth, 1, 3, Result.DONE)))
    assert frames.gaps == 2


@pytest.mark.parametrize(
    "body", ["7f 01 02", "82 00", "03 01", "83 00 01 00 03 63", "02 34 12 07 00 e8 03 00 00 05 00 c8 00 b8"]
)
def test_a_frame_in_order_that_is_no_message_is_counted_and_not_read(body: str) -> None:
    frames = McuFrames()
    assert frames.feed(frame(bytes.fromhex(body))) == []
    assert (frames.not_ours, frames.crc_errors) == (1, 0)


@pytest.mark.parametrize("width", [math.nan, math.inf, -math.inf, None, "1500", -1.0, 40_000.0])
def test_h6_no_width_that_is_none_gets_onto_the_wire(width: Any) -> None:
    with pytest.raises(CommandError):
        encode(SetWidths(1, 1, 0, 0, 200, (1500.0, width)))


def test_more_widths_than_there_can_be_channels_are_refused() -> None:
    with pytest.raises(CommandError, match="17 widths"):
        encode(SetWidths(1, 1, 0, 0, 200, (1500.0,) * 17))


def test_the_computers_clock_may_go_beyond_what_a_stamp_can_say() -> None:
    [message] = McuFrames().feed(encode(SetWidths(1, 1, 2**32 + 5, 0, 200, ())))
    assert isinstance(message, SetWidths)
    assert message.stamp_ms == 5
