"""The codec: however the bytes are split, it returns whole frames, and it reports invalid data at once."""

import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.links.frames import LengthPrefixedReader, encode_frame
from snr_sim.prelude.errors import FrameTooLargeError


@given(st.lists(st.binary(max_size=50), max_size=20), st.lists(st.integers(1, 40), min_size=1))
def test_reader_returns_whole_frames_from_any_split(payloads: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(encode_frame(payload) for payload in payloads)
    reader, came, start, i = LengthPrefixedReader(), [], 0, 0
    while start < len(stream):
        stop = start + cuts[i % len(cuts)]
        came += reader.feed(stream[start:stop])
        start, i = stop, i + 1
    assert came == payloads


def test_payload_beyond_the_limit_raises_error_at_the_sender() -> None:
    assert len(encode_frame(b"x" * 100, max_bytes=100)) == 104
    with pytest.raises(FrameTooLargeError, match=r"101 bytes(.|\n)*100(.|\n)*raise max_frame_bytes"):
        encode_frame(b"x" * 101, max_bytes=100)


def test_weakness_15_length_of_4_gb_raises_error_without_buffering() -> None:
    tracemalloc.start()
    reader = LengthPrefixedReader()
    with pytest.raises(FrameTooLargeError, match="4294967295 bytes"):
        reader.feed(b"\xff\xff\xff\xff")
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak_bytes < 100_000


def test_reader_returns_frames_before_one_that_is_too_long() -> None:
    reader = LengthPrefixedReader(max_bytes=10)
    assert reader.feed(encode_frame(b"good") + b"\x00\x00\x00\x0b") == [b"good"]
    with pytest.raises(FrameTooLargeError, match="11 bytes"):
        reader.feed()


def test_other_protocol_raises_error_with_its_text() -> None:
    with pytest.raises(FrameTooLargeError, match=r"'GET '(.|\n)*browser"):
        LengthPrefixedReader().feed(b"GET / HTTP/1.1\r\n\r\n")


def test_reader_returns_at_most_the_requested_frames() -> None:
    reader = LengthPrefixedReader(max_bytes=4)
    assert reader.feed(encode_frame(b"one") + encode_frame(b"longer"), at_most=1) == [b"one"]
    reader.max_bytes = 100
    assert reader.feed(at_most=1) == [b"longer"]
    assert reader.feed() == []


def test_frame_byte_by_byte_is_not_copied_for_each_byte() -> None:
    # Quadratic copying of 300 000 bytes would take minutes.
    frame = encode_frame(b"x" * 300_000)
    reader, came = LengthPrefixedReader(), []
    for i in range(len(frame)):
        came += reader.feed(frame[i : i + 1])
    assert came == [b"x" * 300_000]
