"""Values as JSON, without loss: encoding of the data in pages and tasks, on disk and on a wire.

Plain JSON stays plain. Other values are wrapped in an object whose key "$" names their kind:

    {"$": "float", "v": "nan"}                         also "inf", "-inf"
    {"$": "int", "v": "0x1f..."}                       beyond 64 bits
    {"$": "tuple", "v": [...]}
    {"$": "bytes", "v": "<base64>"}
    {"$": "dict", "v": [[key, value], ...]}            keys that are not text, or a key "$"
    {"$": "array", "dtype": "float64", "shape": [2], "data": [0.5, 1.0]}    "b64" for "data" above 256 elements
    {"$": "object", "type": "module.Class", "fields": {...}}    anything else: readable, but cannot be decoded

docs/formats.md defines it, snr_sim/schemas/value.schema.json for programs. Other values are rejected here.

Almost every value is plain. So the fast path encodes in C, decodes again and compares: two passes in C are faster than
one walk in Python, and detect every value that JSON would change.
"""

from __future__ import annotations

import base64
import contextlib
import gc
import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from types import ModuleType, NoneType
from typing import Any

import msgspec

from snr_sim.prelude.errors import MissingExtraError, ValueEncodingError

LONG_BYTES = 4096  # from this size on, JSON is decoded without searching for reference cycles


@contextlib.contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Disable the search for reference cycles in the block, for code that creates many objects without cycles.

    Scanning all of them again and again while their number grows takes as long as creating them.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


_encode = msgspec.json.Encoder().encode
_decode = msgspec.json.Decoder().decode
_decode_long = no_garbage_collection()(_decode)

# Errors of decoders for bytes that are not valid JSON, or JSON of another type. For invalid UTF-8, Python's own error
# is raised where text is required, and msgspec's elsewhere.
JSON_ERRORS = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)

TAG = "$"
_KIT = "snr_sim."
_TAG_BYTES = b'"$":'  # inside a JSON string the quotes would be escaped, so this is always a key
_NOT_FINITE = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}
_HEX_INT = re.compile(r"-?0x[0-9a-f]+")
_ARRAY_AS_TEXT_MAX = 256
REAL_DTYPES = frozenset("?bhilqBHILQefd")  # numpy's letters: bool, integers, and floats of at most 64 bits
MAX_KEYS_PER_HASH = 64  # of floats and 64-bit integers, fewer than 50 have one hash
_DTYPE = re.compile(r"bool|u?int(?:8|16|32|64)|float(?:16|32|64)")
_ARRAY_FIELDS = tuple({TAG, "dtype", "shape", name} for name in ("data", "b64"))
MIN_INT, MAX_INT = -(2**63), 2**64 - 1  # of JSON; other integers have a mark
_AS_THEY_ARE = frozenset((NoneType, bool, str))
_CONTAINERS = frozenset((list, dict))
_UNTAGGED = object()
_ITEM_TYPES = {"b": frozenset((bool,)), "i": frozenset((int,)), "u": frozenset((int,)), "f": frozenset((int, float))}


def encode_value(value: Any) -> bytes:
    """Return one line of JSON that `decode_value` turns back into an equal value.

    Raises:
        ValueEncodingError: it refers to itself or is nested too deeply.

    >>> encode_value({"altitude_m": 0.1, "ok": True})
    b'{"altitude_m":0.1,"ok":true}'
    >>> encode_value((1, float("nan")))
    b'{"$":"tuple","v":[1,{"$":"float","v":"nan"}]}'
    """
    try:
        raw = _encode(value)
        if _TAG_BYTES not in raw and (_decode if len(raw) < LONG_BYTES else _decode_long)(raw) == value:
            return raw
    except (TypeError, ValueError, OverflowError, RecursionError):
        pass  # numpy, an unknown object, nested too deeply, a comparison that fails
    return encode_with_tags(value)


def encode_with_tags(value: Any) -> bytes:
    """Return the JSON of a value that is not plain; `encode_value` calls it when needed."""
    try:
        with no_garbage_collection():
            return _encode(_tag_value(value))
    except RecursionError:
        raise ValueEncodingError(
            "A value is nested too deeply to be stored, or contains itself.",
            fix="store numbers, text, lists, dicts and numpy arrays, and no object that points back at its owner.",
        ) from None
    except UnicodeEncodeError as error:
        raise ValueEncodingError(
            f"A value holds text that UTF-8 cannot carry: {error.object[:80]!r}.",
            fix="open the file it came from with errors='replace', or store the bytes.",
        ) from None


def decode_value(raw: bytes | str, kinds: Mapping[str, Callable[..., Any]] | None = None) -> Any:
    """Return the value that `encode_value` wrote.

    Args:
        raw: JSON.
        kinds: classes for further marks: `{"page": Page}` makes `Page(**fields)` from `{"$": "page", ...}`.

    Raises:
        ValueEncodingError: it is not JSON, a mark is unknown, or it contains an object that cannot be decoded.

    >>> decode_value(b'{"$":"tuple","v":[1,2.5]}')
    (1, 2.5)
    """
    data = json_bytes(raw)
    try:
        value = (_decode if len(data) < LONG_BYTES else _decode_long)(data)
    except JSON_ERRORS as error:
        raise ValueEncodingError(f"This is not JSON ({error}): {data[:80]!r}") from error
    return untag(value, kinds or {}) if may_have_tags(data) else value


def json_bytes(raw: bytes | str) -> bytes:
    """Return JSON as bytes; raise ValueEncodingError if it is neither text nor bytes."""
    if isinstance(raw, str):
        return raw.encode(errors="surrogatepass")
    if isinstance(raw, (bytes, bytearray, memoryview)):
        return bytes(raw)
    raise ValueEncodingError(f"This is not JSON but of type {type(raw).__name__}: {raw!r:.80}", fix="text or bytes.")


def may_have_tags(raw: bytes, start: int = 0) -> bool:
    """Return whether there may be a mark from this index on, in JSON with any spacing."""
    # Searching one character is four times as fast as six, and most JSON has no escape at all.
    return raw.find(b"$", start) >= 0 or (raw.find(b"\\") >= 0 and b"\\u0024" in raw)


def _tag_value(value: Any) -> Any:
    """Wrap values that JSON would lose. The order matters: bool before int, subclasses after their plain parents."""
    kind = type(value)
    if kind in _AS_THEY_ARE:
        return value
    if kind is float:
        return value if math.isfinite(value) else {TAG: "float", "v": repr(value)}
    if kind is int:
        return value if MIN_INT <= value <= MAX_INT else {TAG: "int", "v": hex(value)}
    if kind is list:
        return [item if type(item) in _AS_THEY_ARE else _tag_value(item) for item in value] if value else value
    if kind is dict:
        if set(map(type, value)) <= {str} and TAG not in value:
            return {key: _tag_value(item) for key, item in value.items()} if value else value
        return {TAG: "dict", "v": [[_tag_value(key), _tag_value(item)] for key, item in value.items()]}
    if kind is tuple:
        return {TAG: "tuple", "v": [_tag_value(item) for item in value]}
    if kind in (bytes, bytearray):
        return {TAG: "bytes", "v": base64.b64encode(value).decode()}
    return _tag_object(value)


def _tag_object(value: Any) -> Any:
    numpy = sys.modules.get("numpy")
    if numpy is not None and isinstance(value, (numpy.ndarray, numpy.generic)) and value.dtype.char in REAL_DTYPES:
        return _tag_array(value)
    for parent in (bool, int, float, str):
        if isinstance(value, parent):  # an Enum, or a student's subclass of a number
            return _tag_value(parent.__str__(value) if parent is str else parent(value))
    if isinstance(value, (type, ModuleType)):  # their attributes are code; a module's would expose the user's file path
        name = value.__qualname__ if isinstance(value, type) else Path(value.__file__ or value.__name__).stem
        return {TAG: "object", "type": f"builtins.{type(value).__name__}", "fields": {"name": name}}
    if isinstance(value, (dict, list)):  # a subclass of one; its plain values were encoded by the fast path
        return _tag_value(dict(value) if isinstance(value, dict) else list(value))
    config = getattr(type(value), "__struct_config__", None)
    if config is not None:
        if config.tag_field == TAG and config.tag == "page":
            return _tag_page(value)
        if config.tag_field == TAG and config.tag == "array_bytes":  # core/process/messages.py: never on disk
            return {TAG: config.tag, **{name: getattr(value, name) for name in type(value).__struct_fields__}}
        fields = {name: _tag_value(getattr(value, name)) for name in type(value).__struct_fields__}
    else:
        fields = {str(name): _tag_value(item) for name, item in _attributes(value).items()}
    return {TAG: "object", "type": f"{type(value).__module__}.{type(value).__qualname__}", "fields": fields}


def _tag_page(page: Any) -> Any:
    """Return a page whose own fields are plain numbers and text, also if they were numpy's."""
    fields = {name: getattr(page, name) for name in type(page).__struct_fields__}
    plain = {name: item.item() if name != "data" and hasattr(item, "item") else item for name, item in fields.items()}
    return {TAG: "page", **{name: _tag_value(item) for name, item in plain.items()}}


def _attributes(value: Any) -> dict[str, Any]:
    """Return the attributes of an object, from its dict or slots; the items of a set, the text of other numpy values.

    For a part of the program only its name: an endpoint refers to the whole program.
    """
    if is_of_program(value):
        return {"name": getattr(value, "name", "")}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return dict(value._asdict())
    if isinstance(value, (set, frozenset)):
        return {"items": sorted(value, key=encode_value)}
    if hasattr(value, "dtype") and hasattr(value, "tolist"):  # text shows 1000 items at most
        is_list = getattr(value.dtype, "kind", "O") == "O"  # of objects; other libraries have arrays, too
        return {"dtype": str(value.dtype), "values": value.tolist() if is_list else str(value)}
    kept = dict(getattr(value, "__dict__", {}))
    for kind in type(value).__mro__:
        slots = kind.__dict__.get("__slots__", ())
        names = (slots,) if isinstance(slots, str) else slots
        kept |= {name: getattr(value, name) for name in names if name[:2] != "__" and hasattr(value, name)}
    return kept


def is_of_program(value: Any) -> bool:
    """Return whether an object is a part of the program and not data: of a class of `snr_sim`, or derived from one."""
    kind = type(value)
    is_record = hasattr(kind, "__struct_fields__") or hasattr(kind, "__dataclass_fields__")
    if is_record or issubclass(kind, BaseException):
        return False
    return any(base.__module__.startswith(_KIT) for base in kind.__mro__)


def _tag_array(value: Any) -> Any:
    tagged = {TAG: "array", "dtype": value.dtype.name, "shape": list(value.shape)}
    if value.size <= _ARRAY_AS_TEXT_MAX:
        return {**tagged, "data": _tag_value(value.tolist())}
    little_endian = value.astype(value.dtype.newbyteorder("<"), copy=False)
    return {**tagged, "b64": base64.b64encode(little_endian.tobytes()).decode()}


def untag(value: Any, kinds: Mapping[str, Callable[..., Any]]) -> Any:
    """Return decoded JSON with what its marks stand for. Changes the lists and dicts in it."""
    kind = type(value)
    if kind is list:
        for i, item in enumerate(value):
            if item and type(item) in _CONTAINERS:
                value[i] = untag(item, kinds)
        return value
    if kind is not dict:
        return value
    tag = value.get(TAG, _UNTAGGED)
    if tag is _UNTAGGED:
        for key, item in value.items():
            if item and type(item) in _CONTAINERS:
                value[key] = untag(item, kinds)
        return value
    try:
        if type(tag) is str and tag in kinds:
            return kinds[tag](**{key: untag(item, kinds) for key, item in value.items() if key != TAG})
        if tag == "array":
            return _untag_array(value)
        return _untag_simple(tag, value, kinds)
    except (KeyError, TypeError, ValueError, OverflowError, msgspec.ValidationError) as error:
        raise ValueEncodingError(f"A stored value of kind {tag!r} is damaged: {error}.") from error


def _untag_simple(tag: Any, value: dict[str, Any], kinds: Mapping[str, Callable[..., Any]]) -> Any:
    if tag == "object":
        raise ValueEncodingError(
            f"A stored value was an object of class {value['type']!s:.200}, which cannot be brought back from JSON.",
            fix="store a dict, a list, a tuple or a numpy array instead.",
        )
    inner = value.get("v", _UNTAGGED)
    if inner is _UNTAGGED or len(value) != 2:
        raise _wrong_fields(value)
    if tag == "float":
        return _NOT_FINITE[inner]
    if tag == "int":
        return int(_matched(_HEX_INT, inner), 16)
    if tag == "bytes":
        return base64.b64decode(inner, validate=True)
    if type(inner) is not list:
        raise ValueError(f"it holds {inner!r} instead of a list")
    items = untag(inner, kinds)
    if tag == "dict":
        for pair in items:
            if type(pair) is not list:
                raise ValueError("it holds something else than pairs")
        return _dict_of(items)
    if tag != "tuple":
        raise ValueEncodingError(f"A stored value has the unknown kind {tag!r}; known: tuple, array, ...")
    return tuple(items)


def _dict_of(pairs: list[list[Any]]) -> dict[Any, Any]:
    """Return the dict of these pairs.

    Hashes of numbers and tuples are public: a peer can compute keys that all have the same, and 1 MB of them would take
    Python 3 s, in which the node does nothing else.
    """
    if len(pairs) > MAX_KEYS_PER_HASH:
        count = max(Counter([hash(key) for key, _ in pairs]).values())
        if count > MAX_KEYS_PER_HASH:
            raise ValueError(f"{count} of its keys have the same hash")
    return dict(pairs)


def _wrong_fields(value: dict[str, Any]) -> ValueError:
    return ValueError(f"it has the fields {', '.join(value)}")


def _matched(pattern: re.Pattern[str], text: Any) -> str:
    if type(text) is not str or not pattern.fullmatch(text):
        raise ValueError(f"{text!r} is not of this kind")
    return text


def _untag_array(value: dict[str, Any]) -> Any:
    try:
        import numpy as np  # slow to import, and only pages with arrays need it
    except ImportError:
        raise MissingExtraError("numpy", "sim") from None

    if value.keys() not in _ARRAY_FIELDS:
        raise _wrong_fields(value)
    dtype, shape = np.dtype(_matched(_DTYPE, value["dtype"])), value["shape"]
    if type(shape) is not list or set(map(type, shape)) - {int} or min(shape, default=0) < 0:
        raise ValueError("its shape is not a list of lengths")
    if "b64" in value:
        little_endian = base64.b64decode(value["b64"], validate=True)
        flat = np.frombuffer(little_endian, dtype.newbyteorder("<")) if little_endian else np.empty(0, dtype)
        array = flat.astype(dtype).reshape(shape)
    else:
        with np.errstate(over="ignore"):  # 1e300 as float32 is infinite, as everywhere in numpy
            array = np.array(_items(value["data"], shape, _ITEM_TYPES[dtype.kind]), dtype).reshape(shape)
    return array if shape else array[()]


def _items(data: Any, shape: list[int], types: frozenset[type]) -> list[Any]:
    """Return the numbers in lists that are nested according to the shape."""
    level = [data]
    for length in shape:  # a level at a time, which is in C: one number at a time takes five times as long
        if set(map(type, level)) - {list} or set(map(len, level)) - {length}:
            raise ValueError(f"its data are not of shape {shape[:8]}")
        level = level[0] if len(level) == 1 else list(chain.from_iterable(level))
    found = set(map(type, level))
    if dict in found and float in types:
        level = [untag(item, {}) if type(item) is dict else item for item in level]
        found = set(map(type, level))
    if not found <= types:
        raise ValueError(f"it holds {next(item for item in level if type(item) not in types)!r} among its numbers")
    return level
