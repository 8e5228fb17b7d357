"""Limits of the values sent over a link, in addition to the frame length: 64-bit integers, JSON nested 100 deep.

Ordinary code fails beyond them: an integer of 5000 digits has no `str`, one of 310 no `float`, and `repr` of a value
that is nested 900 deep overflows the stack. So such a value could end a component that is correct.

A page may have 1000 numbers with exponents of three digits. msgspec (0.22) takes 20 us to read one beyond 1e289 or
below 1e-307, so 1 MB of them would stop all threads of the program for 3 s.
"""

from __future__ import annotations

import re
from typing import Any, NoReturn

from snr_sim.prelude.errors import ValueEncodingError
from snr_sim.prelude.task import KINDS, Page
from snr_sim.prelude.values import MAX_INT, MIN_INT

MAX_DEPTH = 100  # of nested objects and lists, including the message
MAX_LONG_EXPONENTS = 1000  # a lidar may report 360 times "nothing" as the largest float
# One character for all digits and signs, one kind of brackets for both.
_SHAPE = bytes.maketrans(b"123456789+-{}E", b"00000000000[]e")
_LONG_EXPONENT = re.compile(rb"[eE][+-]?[0-9]{3}")
_LONG_RUN = b"0" * len(str(-MIN_INT))  # fewer digits are always within the limits
_LONG_INT = re.compile(rb"(?<![0-9.eE+-])-?[0-9]{%d,}(?![0-9.eE])" % len(_LONG_RUN))
_MAX_INT_CHARS = len(str(MAX_INT))
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
_MARK = b'{"$":'  # the first in a page is its own
_OWN_INT_MARK = b'"$":"int"'
_OWN_OBJECT_MARK = b'"$":"object"'


def _refuse_int(**fields: Any) -> NoReturn:
    """Reject the mark `int`, which is only for integers of more than 64 bits."""
    raise _too_long()


WIRE_KINDS = {**KINDS, "int": _refuse_int}  # the marks of prelude/values.py, with `int` rejected


def encode_page(page: Page) -> bytes:
    """Return a page encoded for a link.

    Raises:
        ValueEncodingError: it contains a value that links do not carry. It fails at the sender, whose mistake it is.
    """
    raw = page.serialize()
    check_bounds(raw)
    if raw.find(_MARK, len(_MARK)) >= 0 and (_OWN_OBJECT_MARK in raw or _OWN_INT_MARK in raw):
        Page.deserialize(raw, WIRE_KINDS)  # raises an error that names the class
    return raw


def decode_page(raw: bytes) -> Page:
    """Return a page that arrived over a link; raise ValueEncodingError if it is not one, or beyond limits."""
    check_bounds(raw)
    return Page.deserialize(raw, WIRE_KINDS)


def check_bounds(raw: bytes) -> None:
    """Check plain numbers and depth of JSON, before it is decoded; the decoder checks marks.

    Raises:
        ValueEncodingError: an integer is outside of -2^63 .. 2^64-1, too many numbers have long exponents, or the
            nesting is too deep.

    >>> check_bounds(b'{"count":18446744073709551615}')
    >>> check_bounds(b"[" * 100 + b"]" * 100)
    """
    # The first check is cheap, and sufficient for nearly all pages: 0.5 us for 200 bytes, where a full scan takes 5 us.
    shape = raw.translate(_SHAPE)
    if shape.find(_LONG_RUN) >= 0 and _has_long_int(raw):
        raise _too_long()
    if shape.count(b"e000") > MAX_LONG_EXPONENTS:
        check_exponents(raw)
    if len(raw) > 2 * MAX_DEPTH and shape.count(b"[") > MAX_DEPTH and _is_too_deep(raw):
        raise ValueEncodingError(f"A value is nested more than {MAX_DEPTH} deep.", fix="send a flatter value.")


def memory_bytes(raw: bytes) -> int:
    """Return an upper estimate of the memory that decoded JSON takes: `[]` is 2 bytes, and 64 with its place in a list.

    >>> memory_bytes(b'[[],[],[]]')
    330
    """
    return len(raw) + 32 * raw.count(b",") + 64 * raw.count(b"[") + 240 * raw.count(b"{")


def _is_too_deep(raw: bytes) -> bool:
    brackets = without_texts(raw).translate(_SHAPE, _NO_BRACKETS)
    depth = 1  # the innermost are the most frequent, and are removed by C code
    for opened in brackets.replace(b"[]", b"").split(b"]"):
        depth += len(opened)
        if depth > MAX_DEPTH:
            return True
        depth -= 1
    return False


def without_texts(raw: bytes) -> bytes:
    """Return JSON without its texts: brackets and digits in them do not count."""
    if b"\\" in raw:
        raw = raw.replace(b"\\\\", b"").replace(b'\\"', b"")
    return b"".join(raw.split(b'"')[::2])


def _has_long_int(raw: bytes) -> bool:
    found = _LONG_INT.findall(without_texts(raw))
    return any(len(digits) > _MAX_INT_CHARS or not MIN_INT <= int(digits) <= MAX_INT for digits in found)


def check_exponents(raw: bytes) -> None:
    """Raise ValueEncodingError if JSON has so many numbers with long exponents that it takes long to decode."""
    if len(raw) > 5 * MAX_LONG_EXPONENTS and len(_LONG_EXPONENT.findall(without_texts(raw))) > MAX_LONG_EXPONENTS:
        raise ValueEncodingError(
            f"More than {MAX_LONG_EXPONENTS} numbers are beyond 1e99 or below 1e-99.", fix="send them as a numpy array."
        )


def _too_long() -> ValueEncodingError:
    return ValueEncodingError(
        "An integer needs more than 64 bits, but links carry -2^63 to 2^64-1.", fix="send a float, or a string."
    )
