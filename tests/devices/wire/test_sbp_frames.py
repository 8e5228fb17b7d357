"""Frames of the Swift Binary Protocol: bytes of the maker's package, chunks of any size, and junk."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.wire.sbp_frames import SbpFrame, SbpFrames, encode
from tests.devices.wire.wire_streams import BYTES_PER_S, crc_by_bits, fuzz, junk_between, random_junk, read_in_chunks

FRAME = st.builds(SbpFrame, st.integers(0, 0xFFFF), st.binary(max_size=255), st.integers(0, 0xFFFF))
GAP_S = 0.05
HEARTBEAT = SbpFrame(0xFFFF, bytes(4), 0x88BF)


def junk(chance: random.Random) -> bytes:
    """Return 0 to 5 bytes, half of the time the start of a frame."""
    return chance.choice([random_junk(chance), bytes(chance.choices([0x55, 255], k=chance.randint(0, 5)))])


def frames_of(count: int) -> list[SbpFrame]:
    chance = random.Random(count)
    return [SbpFrame(i, chance.randbytes(chance.randint(0, 60)), chance.randint(0, 0xFFFF)) for i in range(count)]


@pytest.mark.parametrize(
    ("frame", "raw"),
    [
        (HEARTBEAT, "55 ff ff bf 88 04 00 00 00 00 8b 30"),
        (
            SbpFrame(0x0208, bytes.fromhex("58 cc 5b 07 01 00 02 00 03 00 7d 00 05 00 01"), 0x88BF),
            "55 08 02 bf 88 0f 58 cc 5b 07 01 00 02 00 03 00 7d 00 05 00 01 b9 56",
        ),
    ],
)
def test_sbp_frame_equals_bytes_of_the_maker(frame: SbpFrame, raw: str) -> None:
    """Made by the package `sbp` 6.5.2."""
    assert encode(frame) == bytes.fromhex(raw)
    assert SbpFrames().feed(bytes.fromhex(raw), 0.0) == [frame]


@given(FRAME)
def test_sbp_frames_round_trip_keeps_frame(frame: SbpFrame) -> None:
    raw = encode(frame)
    assert int.from_bytes(raw[-2:], "little") == crc_by_bits(raw[1:-2])
    assert SbpFrames().feed(raw, 0.0) == [frame]


@given(st.lists(FRAME, max_size=5), st.randoms(use_true_random=False))
def test_sbp_frames_chunk_size_changes_nothing(sent: list[SbpFrame], chance: random.Random) -> None:
    frames = SbpFrames()
    assert read_in_chunks(frames, b"".join(map(encode, sent)), chance) == sent
    assert (frames.frames, frames.damaged, frames.skipped) == (len(sent), 0, 0)


def test_sbp_frames_among_junk_are_all_delivered_in_order() -> None:
    sent, chance = frames_of(400), random.Random(7)
    stream = junk_between([encode(frame) for frame in sent], chance, junk)
    frames = SbpFrames()
    assert read_in_chunks(frames, stream, chance) == sent
    assert frames.skipped == len(stream) - sum(len(encode(frame)) for frame in sent)


@given(st.lists(FRAME, min_size=1, max_size=5), st.lists(st.binary(max_size=8), min_size=5, max_size=5))
def test_sbp_frames_among_any_junk_come_within_gap_of_a_pause(sent: list[SbpFrame], noise: list[bytes]) -> None:
    frames, found = SbpFrames(gap_s=GAP_S), []
    stream = b"".join(before + b"\x55" + encode(frame) for before, frame in zip(noise, sent, strict=False))
    for i in range(len(stream)):
        found += frames.feed(stream[i : i + 1], i / BYTES_PER_S)
    found += frames.feed(b"", len(stream) / BYTES_PER_S + GAP_S)
    assert found == sent


@given(FRAME, st.data())
def test_sbp_frames_flipped_bit_is_rejected(frame: SbpFrame, data: st.DataObject) -> None:
    damaged = bytearray(encode(frame))
    damaged[data.draw(st.integers(0, len(damaged) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    assert frame not in read_in_chunks(SbpFrames(), bytes(damaged), random.Random(0))


@pytest.mark.parametrize("seed", range(2))
def test_sbp_frames_deliver_nothing_from_a_million_random_bytes(seed: int) -> None:
    frames = SbpFrames()
    assert fuzz(frames, 1_000_000, seed) == []
    assert frames.skipped == 1_000_000
    assert frames.damaged > 3000  # one byte in 256 starts a frame, and most of them are complete
