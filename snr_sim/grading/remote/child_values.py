"""Values that a student's process may send to the grader: numbers, texts, lists and dicts, and nothing else."""

from __future__ import annotations

from typing import Any

import msgspec

from snr_sim.core.source_location import location_of, without_addresses
from snr_sim.prelude.errors import ValueEncodingError
from snr_sim.prelude.values import encode_value

_SHOWN = 200  # characters of a value that cannot cross


class UnsendableValueError(Exception):
    """A result of a type that cannot be sent to the grader."""


def encode_plain(value: Any, what: str, function: object) -> bytes:
    """Return JSON of a value that can cross; raise UnsendableValueError if it cannot; the message describes it."""
    try:
        raw = _encode(value)
        if b'"$"' not in raw and _decode(raw) == value:
            return raw  # the usual case: a JSON round trip in C gives the same value
    except (TypeError, ValueError, OverflowError, RecursionError):
        pass
    try:
        return encode_value(plain(value))
    except (UnsendableValueError, RecursionError, ValueEncodingError) as error:
        place = location_of(function)
        reason = error.args[0] if isinstance(error, UnsendableValueError) and error.args else "it is nested too deeply"
        where = f"{place}\n  " if place is not None else ""
        raise UnsendableValueError(f"{where}{what} returned {short(value)}: {reason}.") from None


def plain(value: Any) -> Any:
    """Return a value as numbers, texts, lists and dicts, also numpy's; raise UnsendableValueError for anything else."""
    kind = type(value)
    if value is None or kind in (bool, int, float, str):
        return value
    if kind in (list, tuple):
        return [plain(item) for item in value]
    if kind is dict:
        for key in value:
            if type(key) is not str:
                raise UnsendableValueError(f"the key {short(key)} of a dict is not a string")
        return {key: plain(item) for key, item in value.items()}
    if hasattr(value, "dtype") and hasattr(value, "tolist"):
        return plain(value.tolist())
    for parent in (bool, int, float, str):
        if isinstance(value, parent):
            return parent.__str__(value) if parent is str else parent(value)
    name = f"{'an' if kind.__name__[:1].lower() in 'aeiou' else 'a'} {kind.__name__}"
    raise UnsendableValueError(f"{short(value)} is {name}, not a number, a text, a list or a dict of these")


def short(value: Any) -> str:
    """Return a value as text, truncated; it may be anything, and its `repr` may raise."""
    try:
        text = without_addresses(repr(value))
    except Exception as error:
        text = f"<a {type(value).__name__} whose repr raises {type(error).__name__}>"
    return text if len(text) <= _SHOWN else text[:_SHOWN] + " ..."


_encode = msgspec.json.Encoder().encode
_decode = msgspec.json.Decoder().decode
