"""Values on which ordinary code fails: links neither accept nor send them."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import Page
from snr_sim.console.wire import Reply, decode_request, result_from_reply
from snr_sim.links.frames import MAX_FRAME_BYTES, encode_frame
from snr_sim.links.messages import MAX_DEPTH, MAX_LONG_EXPONENTS, check_bounds, decode_message, decode_page, encode_page
from snr_sim.links.session import Session, SessionConfig
from snr_sim.prelude.errors import ValueEncodingError
from snr_sim.prelude.task import KINDS
from snr_sim.prelude.values import decode_value


def page(data: bytes) -> bytes:
    return b'{"$":"page","key":"x","data":%s,"origin":"a","created_at_s":0}' % data


def nested(depth: int) -> bytes:
    """Return a page of this nesting depth."""
    return page(b"[" * (depth - 1) + b"]" * (depth - 1))


BEYOND = {
    "5000 digits": page(b"9" * 5000),
    "400 digits": page(b"9" * 400),
    "2^64": page(b"18446744073709551616"),
    "below -2^63": page(b"-9223372036854775809"),
    "long, in a list": page(b'["1",1.5,18446744073709551616]'),
    "long, as a value of a key": page(b'{"a\\"":18446744073709551616}'),
    "long, by its mark": page(b'{"$":"int","v":"0x10000000000000000"}'),
    "5000 digits, by its mark": page(b'{"$":"int","v":"%s"}' % hex(10**5000).encode()),
    "its mark, escaped": page(b'{"\\u0024":"\\u0069nt","v":"0x1"}'),
    "its mark, in a tuple": page(b'{"$":"tuple","v":[{"$":"int","v":"0x1"}]}'),
    "its mark, in a page": page(page(b'{"$":"int","v":"0x1"}')),
    "numbers that take long to read": page(b"[" + b",".join([b"1e300"] * (MAX_LONG_EXPONENTS + 1)) + b"]"),
    "the same, in another form": page(b"[" + b",".join([b"0.5E-0309"] * (MAX_LONG_EXPONENTS + 1)) + b"]"),
    "too deep": nested(MAX_DEPTH + 1),
    "deeper": nested(900),
    "too deep, of objects": page(b'{"a":' * MAX_DEPTH + b"1" + b"}" * MAX_DEPTH),
    "too deep, among shallow ones": page(b"[" + b"[]," * 500 + b"[" * MAX_DEPTH + b"]" * MAX_DEPTH + b"]"),
}
WITHIN = {
    "2^64-1": page(b"18446744073709551615"),
    "-2^63": page(b"-9223372036854775808"),
    "digits of a float": page(b"0.00012345678901234567890123"),
    "an exponent": page(b"1e-00000000000000000000000001"),
    "a large float": page(b"10000000000000000000000000000.0"),
    "text": page(b'"99999999999999999999999999"'),
    "text with quotes": page(b'"\\"99999999999999999999999999\\\\"'),
    "a key": page(b'{"99999999999999999999999999":1}'),
    "some numbers that take long to read": page(b"[" + b",".join([b"1.7976931348623157e308"] * 1000) + b"]"),
    "numbers that do not": page(b"[" + b",".join([b"1e-30"] * 5000) + b"]"),
    "text with exponents": page(b'"' + b"e999" * 5000 + b'"'),
    "as deep as may be": nested(MAX_DEPTH),
    "many shallow ones": page(b"[" + b"[[]],{}," * 500 + b"1]"),
    "brackets in text": page(b'"' + b"[" * 500 + b'"'),
}


@pytest.mark.parametrize("what", BEYOND)
def test_value_beyond_the_bounds_closes_the_session(what: str) -> None:
    with pytest.raises((ValueEncodingError, msgspec.DecodeError)):
        decode_message(BEYOND[what])
    with pytest.raises(ValueEncodingError):
        decode_page(BEYOND[what])
    session, far = (
        Session(SessionConfig(name, is_server), 0.0) for name, is_server in (("robot", True), ("raw", False))
    )
    session.receive(b"".join(far.take_output()), 0.0)
    assert session.receive(encode_frame(BEYOND[what]), 0.0) == []
    assert session.is_closed
    assert session.rejected == 1


@pytest.mark.parametrize("what", WITHIN)
def test_value_within_the_bounds_is_accepted(what: str) -> None:
    assert decode_message(WITHIN[what]) == decode_page(WITHIN[what]) == Page.deserialize(WITHIN[what])


@pytest.mark.parametrize("data", [2**64, -(2**63) - 1, 10**5000, (1, 2**64), {"a": [2**70]}, {2**64: 1}], ids=type)
def test_sending_a_long_integer_raises_encoding_error(data: Any) -> None:
    with pytest.raises(ValueEncodingError, match="more than 64 bits"):
        encode_page(Page("x", data, "a", 0.0))


def test_sending_a_deep_value_raises_encoding_error() -> None:
    data: list[Any] = []
    for _ in range(MAX_DEPTH):
        data = [data]
    with pytest.raises(ValueEncodingError, match="nested more than 100 deep"):
        encode_page(Page("x", data, "a", 0.0))


numbers = st.integers(-(2**65), 2**65) | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=30)
keys = st.text(max_size=30).filter(lambda key: key != "$")  # that key would be a mark
values = st.recursive(numbers, lambda inner: st.lists(inner) | st.dictionaries(keys, inner))


def is_within(value: Any, depth: int = 0) -> bool:
    if isinstance(value, (list, dict)):
        items = value.values() if isinstance(value, dict) else value
        return depth < MAX_DEPTH and all(is_within(item, depth + 1) for item in items)
    return not isinstance(value, int) or -(2**63) <= value < 2**64


@given(values, st.integers(0, MAX_DEPTH + 5))
def test_bounds_equal_those_of_a_walk_over_the_value(value: Any, wraps: int) -> None:
    raw = b"[" * wraps + msgspec.json.encode(value) + b"]" * wraps
    try:
        check_bounds(raw)
    except ValueEncodingError:
        assert not is_within(decode_value(raw, KINDS))
    else:
        assert is_within(decode_value(raw, KINDS))


@pytest.mark.wall_clock
def test_depth_of_the_longest_frame_is_found_in_half_the_time_of_its_decoding() -> None:
    item = b"[" * 90 + b"]" * 90
    raw = b"[" + b",".join([item] * (MAX_FRAME_BYTES // (len(item) + 1))) + b"]"
    decode = msgspec.json.Decoder().decode
    assert 2 * min(cpu_s(check_bounds, raw) for _ in range(5)) < min(cpu_s(decode, raw) for _ in range(5))


def filled(unit: bytes) -> bytes:
    """Return a list of as many of this as a quarter of the longest frame holds."""
    return b"[" + b",".join([unit] * (MAX_FRAME_BYTES // 4 // (len(unit) + 1))) + b"]"


def mark(kind: bytes, value: bytes) -> bytes:
    return b'{"$":"%s","v":%s}' % (kind, value)


MARKED = mark(b"tuple", b"[]")
LARGE = {
    "numbers": filled(b"1e300"),
    "lists": filled(b"[]"),
    "lists and a mark": b"[%s,%s]" % (filled(b"[]"), MARKED),
    "lists of a number, and a mark": b"[%s,%s]" % (filled(b"[0]"), MARKED),
    "dicts and a mark": b"[%s,%s]" % (filled(b'{"":0}'), MARKED),
    "tuples": filled(mark(b"tuple", b"[0]")),
    "marked dicts": filled(mark(b"dict", b"[[0,0]]")),
    "keys": mark(b"dict", b"[%s]" % b",".join(b"[%d,0]" % i for i in range(25_000))),
    "arrays": filled(b'{"$":"array","dtype":"float32","shape":[1],"data":[0]}'),
    "deep lists": filled(b"[" * 90 + b"]" * 90),
    "the name of a class": b'{"$":"object","type":"%s","fields":{}}' % (b"\x7f" * (MAX_FRAME_BYTES // 4)),
    "a damaged mark": mark(b"tuple", b'"%s"' % (b"\x7f" * (MAX_FRAME_BYTES // 4))),
}


@pytest.mark.wall_clock
@pytest.mark.parametrize("what", LARGE)
def test_large_page_costs_little_processor_time(what: str) -> None:
    # Before they were bounded, the numbers took 200 times as long as Python's json needs for the same size, names of
    # classes 50 times, lists and a mark 38 times.
    frame, plain = encode_frame(page(LARGE[what])), filled(b'[1.5,"a"]')

    def receive(frame: bytes) -> None:
        session, far = (Session(SessionConfig(name, name == "robot"), 0.0) for name in ("robot", "raw"))
        session.receive(b"".join(far.take_output()), 0.0)
        session.receive(frame, 0.0)

    assert min(cpu_s(receive, frame) for _ in range(4)) < 20 * min(cpu_s(json.loads, plain) for _ in range(4))


def cpu_s(act: Callable[[bytes], object], raw: bytes) -> float:
    begun_s = time.thread_time()
    act(raw)
    return time.thread_time() - begun_s


@pytest.mark.parametrize("number", [b"-1", b"9223372036854775808", b"9" * 4000])
def test_number_of_a_consoles_line_is_bounded(number: bytes) -> None:
    with pytest.raises(msgspec.DecodeError):
        decode_request(b'{"$":"command","number":%s,"line":"help"}' % number)


@pytest.mark.parametrize("data", [b"9" * 400, b'{"$":"int","v":"0x10000000000000000"}', b"[" * 101 + b"]" * 101])
def test_data_of_a_consoles_answer_is_bounded(data: bytes) -> None:
    with pytest.raises(ValueEncodingError):
        result_from_reply(Reply(1, "", msgspec.Raw(data), False, ""))
