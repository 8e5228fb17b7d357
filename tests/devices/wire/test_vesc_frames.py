"""Frames of a VESC: bytes worked by hand, chunks of any size, and junk that looks like the start of a frame."""

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.wire.vesc_frames import MAX_PAYLOAD, VescFrames, encode
from snr_sim.prelude.errors import CommandError
from tests.devices.wire.wire_streams import BYTES_PER_S, crc_by_bits, fuzz, junk_between, random_junk, read_in_chunks

PAYLOAD = st.binary(min_size=1, max_size=300)
GAP_S = 0.02


def junk(chance: random.Random) -> bytes:
    """Return 0 to 5 bytes, half of the time those that claim the longest frames."""
    return chance.choice([random_junk(chance), bytes(chance.choices([2, 3, 255], k=chance.randint(0, 5)))])


def frames_of(count: int) -> list[bytes]:
    """Return payloads that differ."""
    chance = random.Random(count)
    return [i.to_bytes(4, "big") + chance.randbytes(chance.randint(0, 60)) for i in range(count)]


@pytest.mark.parametrize(
    ("payload", "frame"),
    [
        (b"\x04", "02 01 04 40 84 03"),  # 4 * (x^16 mod polynomial) = 4 * 0x1021
        (b"123456789", "02 09 31 32 33 34 35 36 37 38 39 31 c3 03"),  # the check value of CRC-16/XMODEM
        (bytes(255), "02 ff" + "00" * 255 + "00 00 03"),
        (bytes(256), "03 01 00" + "00" * 256 + "00 00 03"),
    ],
)
def test_vesc_encode_equals_bytes_worked_by_hand(payload: bytes, frame: str) -> None:
    assert encode(payload) == bytes.fromhex(frame)
    assert VescFrames().feed(bytes.fromhex(frame), 0.0) == [payload]


@given(PAYLOAD)
def test_vesc_frames_round_trip_keeps_payload(payload: bytes) -> None:
    frame = encode(payload)
    assert int.from_bytes(frame[-3:-1], "big") == crc_by_bits(payload)
    assert VescFrames().feed(frame, 0.0) == [payload]


@pytest.mark.parametrize("size", [0, MAX_PAYLOAD + 1])
def test_vesc_encode_payload_of_wrong_size_raises_command_error(size: int) -> None:
    with pytest.raises(CommandError, match=f"{size} bytes does not fit"):
        encode(bytes(size))


@given(st.lists(PAYLOAD, max_size=6), st.randoms(use_true_random=False))
def test_vesc_frames_chunk_size_changes_nothing(payloads: list[bytes], chance: random.Random) -> None:
    frames = VescFrames()
    assert read_in_chunks(frames, b"".join(map(encode, payloads)), chance) == payloads
    assert (frames.frames, frames.damaged, frames.skipped) == (len(payloads), 0, 0)


def test_vesc_frames_among_junk_are_all_delivered_in_order() -> None:
    payloads, chance = frames_of(400), random.Random(7)
    stream = junk_between([encode(payload) for payload in payloads], chance, junk)
    frames = VescFrames()
    assert read_in_chunks(frames, stream, chance) == payloads
    assert frames.skipped == len(stream) - sum(len(encode(payload)) for payload in payloads)


def test_vesc_frames_without_both_rules_lose_frames() -> None:
    """What a plain reader does: believe any length, and wait for it without end."""
    payloads, chance = frames_of(400), random.Random(7)
    stream = junk_between([encode(payload) for payload in payloads], chance, junk)
    plain = VescFrames(max_payload=65535, gap_s=math.inf)
    assert len(read_in_chunks(plain, stream, chance)) < len(payloads) / 2


@given(st.lists(PAYLOAD, min_size=1, max_size=8), st.lists(st.binary(max_size=8), min_size=8, max_size=8))
def test_vesc_frames_among_any_junk_come_within_gap_of_a_pause(payloads: list[bytes], noise: list[bytes]) -> None:
    frames, found = VescFrames(gap_s=GAP_S), []
    stream = b"".join(before + encode(payload) for before, payload in zip(noise, payloads, strict=False))
    for i in range(len(stream)):
        found += frames.feed(stream[i : i + 1], i / BYTES_PER_S)
    found += frames.feed(b"", len(stream) / BYTES_PER_S + GAP_S)
    assert found == payloads


@given(st.binary(max_size=300), PAYLOAD)
def test_vesc_frames_after_any_junk_and_a_pause_read_next_frame_at_once(before: bytes, payload: bytes) -> None:
    frames = VescFrames(gap_s=GAP_S)
    frames.feed(before, 0.0)
    assert frames.feed(encode(payload), 1.5 * GAP_S)[-1:] == [payload]


def test_vesc_frames_behind_junk_wait_for_what_it_claims_and_no_longer() -> None:
    good = encode(b"good")
    frames = VescFrames(gap_s=GAP_S)
    assert frames.feed(b"\x02\x40" + good, 0.0) == []  # 0x40 + 5 bytes, it claims
    assert frames.feed(bytes(0x40 + 5 - 2 - len(good)), 0.001) == [b"good"]
    assert frames.damaged == 1
    frames = VescFrames(gap_s=GAP_S)
    assert frames.feed(b"\x02\x40" + good, 0.0) == []
    assert frames.feed(b"", GAP_S) == []
    assert frames.feed(b"", GAP_S + 0.001) == [b"good"]
    assert (frames.damaged, frames.skipped) == (0, 2)


def test_vesc_frames_called_seldom_read_a_frame_in_two_pieces() -> None:
    frame = encode(b"slow reader")
    for cut in range(1, len(frame)):
        frames = VescFrames(gap_s=GAP_S)
        assert frames.feed(frame[:cut], 5.0) == []  # after a pause
        assert frames.feed(frame[cut:], 5.0 + 10.0 * GAP_S) == [b"slow reader"]


@pytest.mark.parametrize("claim", ["03 04 01", "03 00 ff", "02 00 00", "03 ff ff"])
def test_vesc_frames_impossible_length_is_junk_at_once(claim: str) -> None:
    frames = VescFrames()
    assert frames.feed(bytes.fromhex(claim) + encode(b"good"), 0.0) == [b"good"]
    assert (frames.damaged, frames.skipped) == (0, 3)


@given(PAYLOAD, st.data())
def test_vesc_frames_flipped_bit_invents_no_payload(payload: bytes, data: st.DataObject) -> None:
    damaged = bytearray(encode(payload))
    damaged[data.draw(st.integers(0, len(damaged) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    assert payload not in read_in_chunks(VescFrames(), bytes(damaged), random.Random(0))


@pytest.mark.parametrize("seed", range(2))
def test_vesc_frames_deliver_nothing_from_a_million_random_bytes(seed: int) -> None:
    frames = VescFrames()
    assert fuzz(frames, 1_000_000, seed) == []
    assert frames.skipped == 1_000_000
    assert frames.damaged > 10  # an end where the length says, and a wrong CRC


def test_vesc_frames_keep_no_more_than_one_frame() -> None:
    frames = VescFrames()
    for i in range(40):
        frames.feed(b"\x03" * 100, i * 0.001)  # claims 0x0303 bytes each time
        assert len(frames._rest) <= MAX_PAYLOAD + 6


def test_vesc_payloads_of_the_streams_differ() -> None:
    payloads = frames_of(400)
    assert all(one < other for one, other in pairwise(payloads))
