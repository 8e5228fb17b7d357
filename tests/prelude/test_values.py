"""Values of all types survive the round trip through JSON, to the bit."""

import dataclasses
import json
import math
import re
import struct
import sys
from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from snr_sim.prelude.errors import ValueEncodingError
from snr_sim.prelude.task import KINDS, Page, snapshot
from snr_sim.prelude.values import MAX_KEYS_PER_HASH, decode_value, encode_value

scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.integers(min_value=-(2**70), max_value=2**70),
    st.floats(),
    st.text(st.characters(exclude_categories=["Cs"])),
    st.just("$"),
    st.just('"$":'),
    st.binary(max_size=20),
)
keys = st.one_of(st.text(st.characters(exclude_categories=["Cs"]), max_size=5), st.just("$"), st.integers())
values = st.recursive(
    scalars,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.lists(inner, max_size=4).map(tuple), st.dictionaries(keys, inner, max_size=4)
    ),
    max_leaves=12,
)


def same(one: Any, other: Any) -> bool:
    """Equal in type, structure and every bit of every float."""
    if type(one) is not type(other):
        return False
    if isinstance(one, float):
        return struct.pack("<d", one) == struct.pack("<d", other) or (math.isnan(one) and math.isnan(other))
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict):
        return list(map(repr, one)) == list(map(repr, other)) and all(map(same, one.values(), other.values()))
    return bool(one == other)


@given(values)
@example(-0.0)
@example(5e-324)
@example([float("nan"), float("inf"), -float("inf")])
@example({"$": "float", "v": "nan"})
@example({"$": {"$": 1}})
@example({1: "a", "1": "b"})
@example([(1, [2, (3,)]), {"k": (4, 5)}])
@example({(1, b"x"): {None: 2}})
@example(2**64)
@example(-(2**63) - 1)
@example(2**53 + 1)
@example(b"\xff\x00")
@example(10**5000)
def test_value_round_trips(value: Any) -> None:
    assert same(decode_value(encode_value(value)), value)


@given(st.floats())
def test_every_float_survives_alone_and_in_company(x: float) -> None:
    assert same(decode_value(encode_value({"x": x, "list": [x, 1]})), {"x": x, "list": [x, 1]})


dtypes = st.one_of(
    hnp.boolean_dtypes(),
    hnp.integer_dtypes(endianness="="),
    hnp.unsigned_integer_dtypes(endianness="="),
    hnp.floating_dtypes(endianness="=", sizes=(16, 32, 64)),
)


@given(hnp.arrays(dtypes, hnp.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=8)))
def test_array_round_trips_with_type_and_shape(array: np.ndarray) -> None:
    back = decode_value(encode_value(array))
    assert back.dtype == array.dtype
    assert back.shape == array.shape
    np.testing.assert_array_equal(back, array)


@pytest.mark.parametrize("size", [1, 256, 257, 10_000])
@pytest.mark.parametrize("dtype", ["bool", "int8", "uint64", "int64", "float16", "float32", "float64"])
def test_large_arrays_survive_too(dtype: str, size: int) -> None:
    array = (np.arange(size) * 3 - 7).astype(dtype)
    back = decode_value(encode_value({"image": array}))["image"]
    assert back.dtype == array.dtype
    np.testing.assert_array_equal(back, array)


@pytest.mark.parametrize(
    "array",
    [np.arange(6, dtype=">f8"), np.arange(12).reshape(3, 4).T, np.arange(12)[::2]],
    ids=["big endian", "transposed", "strided"],
)
def test_unusual_arrays_come_back_equal(array: np.ndarray) -> None:
    np.testing.assert_array_equal(decode_value(encode_value(array)), array)


@pytest.mark.parametrize(
    "value",
    [
        np.float64(0.1),
        np.float32(0.1),
        np.int64(-5),
        np.uint64(2**64 - 1),
        np.bool_(True),
        np.float64("nan"),
        np.str_("a"),
    ],
)
def test_numpy_scalars_come_back_equal(value: Any) -> None:
    back = decode_value(encode_value([value]))[0]
    assert back == value or (value != value and back != back)


@dataclasses.dataclass
class Pose:
    x_m: float
    label: str


@dataclasses.dataclass(slots=True)
class SlottedPose:
    x_m: float


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ({"b", "a"}, b'{"$":"object","type":"builtins.set","fields":{"items":["a","b"]}}'),
        (np.array([1j]), b'ndarray","fields":{"dtype":"complex128","values":"[0.+1.j]"}}'),
        (np.array(["ab"]), b'"values":"[\'ab\']"'),
        (np.datetime64("2026-01-02"), b'"values":"2026-01-02"'),
        (np.longdouble(1), b'"values":"1.0"'),
    ],
)
def test_sets_and_unusual_arrays_are_readable_and_raise_on_decode(value: Any, shown: bytes) -> None:
    objects: list[Any] = []
    assert snapshot([value], objects)[0] is value
    assert objects == [value]
    assert shown in encode_value([value])
    with pytest.raises(ValueEncodingError, match=f"{type(value).__name__}, which cannot be brought back"):
        decode_value(encode_value([value]))


@pytest.mark.parametrize("value", [Pose(1.5, "start"), {"pose": Pose(1.5, "start")}, [SlottedPose(1.5)]])
def test_object_is_readable_in_file_and_raises_on_decode(value: Any) -> None:
    raw = encode_value(value)
    assert b'"x_m":1.5' in raw
    assert b"Pose" in raw
    with pytest.raises(ValueEncodingError, match=r"Pose, which cannot be brought back(.|\n)*store a dict"):
        decode_value(raw)


def test_recursive_value_is_rejected() -> None:
    loop: list[Any] = []
    loop.append(loop)
    with pytest.raises(ValueEncodingError, match="contains itself"):
        encode_value(loop)


@pytest.mark.parametrize("value", ["\ud800", {"\ud800": 1}])
def test_invalid_unicode_raises_with_message(value: Any) -> None:
    with pytest.raises(ValueEncodingError, match="UTF-8"):
        encode_value(value)


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        b"{",
        b'{"$":"float"}',
        b'{"$":"float","v":"x"}',
        b'{"$":"nothing","v":[]}',
        b'{"$":5,"v":[]}',
        b'{"$":"array","dtype":"object","shape":[1],"data":[1]}',
        b'{"$":"array","dtype":"float64","shape":[3],"data":[1]}',
        b'{"$":"bytes","v":"?"}',
        b'{"$":"set","v":[[1]]}',
        b'{"$":"dict","v":[1]}',
        b'{"$":"tuple","v":5}',
        b"\xff",
        b'"\x80"',
        b'{"\x80":1}',
    ],
)
def test_damaged_values_raise_with_message(raw: bytes) -> None:
    with pytest.raises(ValueEncodingError):
        decode_value(raw)


@given(values)
def test_equal_values_have_equal_bytes(value: Any) -> None:
    raw = encode_value(value)
    assert encode_value(decode_value(raw)) == raw
    assert b"\n" not in raw


# The schema that ships and the code agree


@given(st.one_of(values, hnp.arrays(dtypes, hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=8))))
@example(np.float32("nan"))
@example(np.array(["ab", "c"]))
@example(np.array([b"ab"]))
@example(np.array(["2026-01-02"], dtype="datetime64[25s]"))
@example(np.timedelta64(3, "ms"))
@example(np.array([1, 2], dtype="longdouble"))
@example(np.arange(3, dtype=">c16"))
@example(np.zeros(300))
@example({np.int8(3): 1, (1, (2,)): 2, Page("a", 1, "n", 0.0): 3})
@example({(1, b"x"): {None: 2}})
@example([Page("a", {"b": {1}}, "n", math.nan), dataclasses.make_dataclass("Pose", ["x_m"])(1.5)])
@example(Page("a", 1, "n", np.float64(0.5), np.bool_(True)))
def test_every_encoded_value_matches_schema(validator: Any, value: Any) -> None:
    assert validator("value")(json.loads(encode_value(value)))


texts = st.sampled_from(
    ["", "$", "v", "nan", "inf", "NaN", "0x1f", "-0x0", "0X1f", "1f", "YQ==", "YQ=", "YQ==\n", "ab", "a b",
     "bool", "int8", "uint64", "float32", "float64", "float", "<f8", "<c16", "<U2", "<M8[ms]"]
)  # fmt: skip
leaves = st.one_of(st.none(), st.booleans(), st.integers(-3, 300), st.floats(allow_nan=False, allow_infinity=False))
kinds = ["float", "int", "bytes", "tuple", "dict", "array", "object", "page", "set"]


def marked(inner: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Objects with a tag that are valid, or nearly."""
    dtype, shape = texts, st.one_of(st.lists(st.integers(-1, 3), max_size=2), inner)
    page = {"key": texts, "data": inner, "origin": texts, "created_at_s": leaves}
    return st.one_of(
        st.fixed_dictionaries({"$": st.sampled_from(kinds), "v": inner}),
        st.fixed_dictionaries({"$": st.sampled_from(kinds), "v": texts}),
        st.fixed_dictionaries({"$": st.sampled_from(kinds[3:5]), "v": st.lists(st.lists(inner, max_size=2))}),
        st.fixed_dictionaries({"$": st.just("array"), "dtype": dtype, "shape": shape, "data": inner}),
        st.fixed_dictionaries({"$": st.just("array"), "dtype": dtype, "shape": shape, "b64": texts}),
        st.fixed_dictionaries({"$": st.just("page"), **page}, optional={"process": leaves, "v": inner}),
        st.fixed_dictionaries({"$": inner}, optional={"v": inner, "type": texts, "fields": inner}),
    )


json_values = st.recursive(
    st.one_of(leaves, texts),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(texts, inner, max_size=2), marked(inner), marked(inner)
    ),
    max_leaves=8,
)


@given(json_values, st.booleans())
@example({"$": "tuple", "v": "ab"}, False)
@example({"$": "dict", "v": ["ab"]}, False)
@example({"$": "dict", "v": [{"$": "tuple", "v": [1, 2]}]}, False)
@example({"$": "set", "v": [1]}, False)
@example({"$": "tuple", "v": [], "w": 1}, False)
@example({"$": "int", "v": "1_0"}, False)
@example({"$": "int", "v": "0x1\n"}, False)
@example({"$": "bytes", "v": "YQ==\n"}, False)
@example({"$": "float", "v": 1.5}, False)
@example({"$": "array", "dtype": "int8", "shape": [1], "data": [1.5]}, False)
@example({"$": "array", "dtype": "int8", "shape": [-1], "data": [1]}, False)
@example({"$": "array", "dtype": "float64", "shape": [1], "data": ["1"]}, False)
@example({"$": "page", "key": 5, "data": 1, "origin": "n", "created_at_s": 0.0}, False)
@example({"$": "page", "key": "k", "data": 1, "origin": "n", "created_at_s": 0.0}, True)
@example({"$": "tuple", "v": [1]}, True)
def test_decoder_accepts_exactly_what_schema_allows(validator: Any, value: Any, is_spaced: bool) -> None:
    raw = json.dumps(value)
    if is_spaced:  # as another program may write it
        raw = re.sub(r'"\$":', '"\\\\u0024" : ', raw)
    try:
        decode_value(raw, KINDS)
    except ValueEncodingError as error:
        # A schema cannot count: whether data, shape and dtype agree, only the reader sees.
        is_beyond_a_schema = "cannot be brought back" in str(error) or "kind 'array'" in str(error)
        assert is_beyond_a_schema or not validator("value")(value), (raw, error)
    else:
        assert validator("value")(value), raw


@pytest.mark.parametrize(
    ("array", "expected"),
    [
        ({"dtype": "int8", "shape": [2], "data": [1]}, "not of shape"),
        ({"dtype": "int8", "shape": [1, 2], "data": [1, 2]}, "not of shape"),
        ({"dtype": "int8", "shape": [1], "data": [300]}, "300"),
        ({"dtype": "float64", "shape": [1], "b64": "YQ=="}, "size"),
    ],
)
def test_inconsistent_arrays_are_rejected(validator: Any, array: dict[str, Any], expected: str) -> None:
    assert validator("value")({"$": "array", **array})
    with pytest.raises(ValueEncodingError, match=expected):
        decode_value(json.dumps({"$": "array", **array}))


@pytest.mark.parametrize("change", [{"key": 1}, {"created_at_s": "now"}, {"process": 1}, {"extra": 1}, {"$": "pages"}])
@pytest.mark.parametrize("data", [1, {"$": "tuple", "v": []}])
def test_page_with_damaged_field_is_rejected(validator: Any, change: dict[str, Any], data: Any) -> None:
    page = {"$": "page", "key": "k", "data": data, "origin": "n", "created_at_s": 0.5, "process": True}
    assert validator("page")(page)
    assert Page.deserialize(json.dumps(page)).key == "k"
    assert not validator("page")(page | change)
    with pytest.raises(ValueEncodingError, match="page"):
        Page.deserialize(json.dumps(page | change))


@pytest.mark.parametrize("part", [b'"k"', b'"n"', b"1"])
def test_page_with_invalid_utf8_is_rejected(part: bytes) -> None:
    raw = b'{"$":"page","key":"k","data":1,"origin":"n","created_at_s":0.5,"process":true}'
    assert Page.deserialize(raw).key == "k"
    with pytest.raises(ValueEncodingError, match="not a page"):
        Page.deserialize(raw.replace(b":" + part, b':"\x80"'))


@pytest.mark.parametrize("field", ["$", "key", "data", "origin", "created_at_s"])
def test_page_without_a_field_is_rejected(validator: Any, field: str) -> None:
    page = {"$": "page", "key": "k", "data": 1, "origin": "n", "created_at_s": 0.5, "process": True}
    del page[field]
    assert not validator("page")(page)
    with pytest.raises(ValueEncodingError):
        decode_value(json.dumps([page]), KINDS) if field != "$" else Page.deserialize(json.dumps(page))


def test_page_with_non_finite_time_round_trips() -> None:
    page = Page("k", (1, 2), "n", math.inf)
    assert Page.deserialize(page.serialize()) == page


# Keys whose hashes a peer has computed


def tuple_of_hash(first: int, target: int = 12345) -> tuple[int, int] | None:
    """Return (first, second) with this hash, or None if no integer `second` does: tuplehash() of CPython."""
    prime_1, prime_2, prime_5, word = 11400714785074694791, 14029467366897019727, 2870177450012600261, 2**64

    def rotated(x: int, bits: int) -> int:
        return (x << bits | x >> (64 - bits)) % word

    before = rotated((prime_5 + first * prime_2) % word, 31) * prime_1 % word
    after = rotated((target - (2 ^ prime_5 ^ 3527539)) * pow(prime_1, -1, word) % word, 33)
    second = (after - before) * pow(prime_2, -1, word) % word
    second -= word if second >= word // 2 else 0
    return (first, second) if -sys.hash_info.modulus < second < sys.hash_info.modulus and second != -1 else None


TUPLES = [pair for first in range(1, 1000) if (pair := tuple_of_hash(first)) is not None][:200]
ONE_HASH: dict[str, list[Any]] = {
    "integers": [5 + k * sys.hash_info.modulus for k in range(200)],
    "tuples": TUPLES,
    "tuples of tuples": [("key", pair) for pair in TUPLES],
    "the same key": [(1, 2)] * 200,
}


@given(st.sampled_from(sorted(ONE_HASH)), st.integers(0, 200), st.lists(keys, max_size=20), st.randoms())
def test_no_dict_has_more_keys_of_one_hash_than_its_bound(
    family: str, count: int, others: list[Any], random: Any
) -> None:
    pairs = [(key, 0) for key in [*ONE_HASH[family][:count], *others]]
    random.shuffle(pairs)
    raw = json.dumps({"$": "dict", "v": [[json.loads(encode_value(key)), 0] for key, _ in pairs]})
    if max(Counter(hash(key) for key, _ in pairs).values(), default=0) <= MAX_KEYS_PER_HASH:
        assert decode_value(raw) == dict(pairs)
    else:
        with pytest.raises(ValueEncodingError, match="of its keys have the same hash"):
            decode_value(raw)


def test_keys_of_a_map_or_a_table_are_far_from_the_bound() -> None:
    places = [(0.5 * i, -0.5 * k) for i in range(-40, 40) for k in range(-40, 40)]
    powers = [2.0**k for k in range(-1074, 1024)] + [2**k for k in range(64)] + [-(2**k) for k in range(64)]
    for found in (places, powers, [(i, k, True) for i in range(80) for k in range(80)]):
        value = dict.fromkeys(found, 1)
        assert decode_value(encode_value(value)) == value
    assert len({hash(pair) for pair in TUPLES}) == 1
    assert len(TUPLES) == 200
