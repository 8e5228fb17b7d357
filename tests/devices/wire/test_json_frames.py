"""JSON objects of devices, in both framings: bytes worked by hand, chunks, junk, and what is refused."""

import json
import math
import random
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.wire.json_frames import (
    MAX_DEPTH,
    MAX_LINE_BYTES,
    JsonFrames,
    JsonLines,
    encode_frame,
    encode_line,
)
from snr_sim.prelude.errors import CommandError
from tests.devices.wire.wire_streams import fuzz, junk_between, random_junk, read_in_chunks

Encode = Callable[[dict[str, Any]], bytes]
LEAF = st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats(allow_nan=False, allow_infinity=False)
TEXT = st.lists(st.sampled_from(["a", "é", "名", "\n", '"', "\\", "{", "\x02{", "\0"]), max_size=5).map("".join)
VALUE = st.recursive(LEAF | TEXT, lambda inner: st.lists(inner, max_size=3), max_leaves=4)
OBJECT = st.dictionaries(TEXT, VALUE, max_size=3).filter(lambda value: len(json.dumps(value)) < 200)
BOTH = pytest.mark.parametrize("encode", [encode_frame, encode_line])


class TimedLines(JsonLines):
    """Lines that are fed as frames are: with the time."""

    def feed(self, data: bytes, now_s: float = 0.0) -> list[dict[str, Any]]:
        return super().feed(data)


def reader_of(encode: Encode) -> Any:
    return JsonFrames() if encode is encode_frame else TimedLines()


def nested(depth: int) -> dict[str, Any]:
    value: dict[str, Any] = {}
    for _ in range(depth - 1):
        value = {"a": value}
    return value


@pytest.mark.parametrize(
    ("encode", "value", "raw"),
    [
        (encode_frame, {"lamp": 70}, b'\x0b{"lamp":70}'),
        (encode_line, {"lamp": 70}, b'{"lamp":70}\n'),
        (encode_frame, {}, b"\x02{}"),
        (encode_line, {"name": "a\nb"}, b'{"name":"a\\nb"}\n'),
        (encode_frame, {"é": [1.5, True, None]}, b'\x16{"\xc3\xa9":[1.5,true,null]}'),
    ],
)
def test_json_encode_equals_bytes_worked_by_hand(encode: Encode, value: dict[str, Any], raw: bytes) -> None:
    assert encode(value) == raw
    assert reader_of(encode).feed(raw, 0.0) == [value]


@BOTH
@given(st.lists(OBJECT, max_size=5), st.randoms(use_true_random=False))
def test_json_round_trip_in_any_chunks_keeps_objects(
    encode: Encode, values: list[dict[str, Any]], chance: random.Random
) -> None:
    reader = reader_of(encode)
    assert read_in_chunks(reader, b"".join(map(encode, values)), chance) == values
    assert (reader.frames, reader.damaged) == (len(values), 0)


def test_json_frames_among_junk_are_all_delivered_in_order() -> None:
    values, chance = [{"n": i, "list": [i] * (i % 30)} for i in range(400)], random.Random(7)
    stream = junk_between([encode_frame(value) for value in values], chance, random_junk)
    assert read_in_chunks(JsonFrames(), stream, chance) == values
    claims = junk_between([encode_frame(value) for value in values], chance, lambda _: b"\xff{")
    assert read_in_chunks(JsonFrames(), claims, chance) == values


def test_json_lines_among_junk_lines_are_all_delivered_in_order() -> None:
    values, chance = [{"n": i} for i in range(400)], random.Random(7)
    stream = junk_between([encode_line(value) for value in values], chance, lambda of: random_junk(of) + b"\n")
    assert read_in_chunks(TimedLines(), stream, chance) == values


def test_json_line_with_other_bytes_is_damaged_and_nothing_of_it_delivered() -> None:
    lines = JsonLines()
    for line in (b'x{"a":1}\n', b'{"a":1\n', b'"b":{"a":1}}\n', b"\xff\n", b"[1]\n", b"7\n"):
        assert lines.feed(line) == []
    assert lines.damaged == 6
    assert lines.feed(b"\r\n \n") == []  # empty
    assert lines.damaged == 6


@BOTH
@pytest.mark.parametrize(
    "raw",
    [
        b'{"a":NaN}', b'{"a":1e999}', b'{"a":-1e999}', b'{"a":18446744073709551616}', b'{"a":%s}' % (b"9" * 200),
        b"[{}]", b'"{}"', b'{"a":1}}', b"{'a':1}", b'{"a":"\xff"}', b'{"a":%s1%s}' % (b"[" * 8, b"]" * 8),
        b'{"a":%s' % (b"[" * 100),
    ],
)  # fmt: skip
def test_json_decode_counts_other_values_as_damaged(encode: Encode, raw: bytes) -> None:
    reader = reader_of(encode)
    framed = bytes([len(raw)]) + raw if encode is encode_frame else raw + b"\n"
    assert reader.feed(framed, 0.0) == []
    assert reader.damaged == (1 if encode is encode_line or raw.startswith(b"{") else 0)


@BOTH
def test_json_depth_is_limited_at_both_ends(encode: Encode) -> None:
    assert reader_of(encode).feed(encode(nested(MAX_DEPTH)), 0.0) == [nested(MAX_DEPTH)]
    with pytest.raises(CommandError, match="not an object"):
        encode(nested(MAX_DEPTH + 1))


@BOTH
@pytest.mark.parametrize(
    "value",
    [
        {"a": math.nan}, {"a": [math.inf]}, {"a": 2**64}, {1: "a"}, [1], "text", None, {"a": {1, 2}}, {"a": (1,)},
        {"a": object()}, {"a": "\ud800"}, {"a": "x" * MAX_LINE_BYTES},
    ],
)  # fmt: skip
def test_json_encode_of_other_values_raises_command_error(encode: Encode, value: Any) -> None:
    with pytest.raises(CommandError, match=r"not an object of at most (255|4096) bytes"):
        encode(value)


def test_json_longest_objects_fit_and_longer_ones_do_not() -> None:
    assert len(encode_frame({"a": "x" * 247})) == 256
    with pytest.raises(CommandError):
        encode_frame({"a": "x" * 248})
    assert len(encode_line({"a": "x" * (MAX_LINE_BYTES - 8)})) == MAX_LINE_BYTES + 1


@pytest.mark.parametrize("reader", [JsonFrames, TimedLines])
def test_json_readers_deliver_nothing_from_a_million_random_bytes(reader: Callable[[], Any]) -> None:
    read = reader()
    assert fuzz(read, 1_000_000, seed=0) == []
    assert read.damaged > 1000
