"""Limits of the values sent over a link, in addition to the frame length: 64-bit integers, JSON nested 100 deep.

Ordinary code fails beyond them: an integer of 5000 digits has no `str`, one of 310 no `float`, and `repr` of a value
that is nested 900 deep overflows the stack. So such a value could end a component that is correct.
"""

from __future__ import annotations

import re
from typing import Any, NoReturn

from snr_sim.prelude.errors import ValueEncodingError
from snr_sim.prelude.task import KINDS, Page

MAX_DEPTH = 100  # of nested objects and lists, including the message
MIN_INT, MAX_INT = -(2**63), 2**64 - 1
_SHAPE = bytes.maketrans(b"123456789{}", b"000000000[]")  # one digit for all digits, one kind of brackets for both
_LONG_RUN = b"0" * len(str(-MIN_INT))  # fewer digits are always within the limits
_LONG_INT = re.compile(rb"(?<![0-9.eE+-])-?[0-9]{%d,}(?![0-9.eE])" % len(_LONG_RUN))
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
    page = Page.deserialize(raw, WIRE_KINDS)
    check_bounds(raw)
    return page


def check_bounds(raw: bytes) -> None:
    """Check plain integers and depth of JSON that is known to be valid; the decoder checks marks.

    Raises:
        ValueEncodingError: an integer is outside of -2^63 .. 2^64-1, or the nesting is too deep.

    >>> check_bounds(b'{"count":18446744073709551615}')
    >>> check_bounds(b"[" * 100 + b"]" * 100)
    """
    # The first check is cheap, and sufficient for nearly all pages: 0.5 us for 200 bytes, where a full scan takes 5 us.
    shape = raw.translate(_SHAPE)
    if shape.find(_LONG_RUN) >= 0 and _has_long_int(raw):
        raise _too_long()
    if len(raw) > 2 * MAX_DEPTH and shape.count(b"[") > MAX_DEPTH and _is_too_deep(raw):
        raise ValueEncodingError(f"A value is nested more than {MAX_DEPTH} deep.", fix="send a flatter value.")


def _is_too_deep(raw: bytes) -> bool:
    brackets = _without_texts(raw).translate(_SHAPE, _NO_BRACKETS)
    depth = 1  # the innermost are the most frequent, and are removed by C code
    for opened in brackets.replace(b"[]", b"").split(b"]"):
        depth += len(opened)
        if depth > MAX_DEPTH:
            return True
        depth -= 1
    return False


def _without_texts(raw: bytes) -> bytes:
    if b"\\" in raw:
        raw = raw.replace(b"\\\\", b"").replace(b'\\"', b"")
    return b"".join(raw.split(b'"')[::2])


def _has_long_int(raw: bytes) -> bool:
    # Python parses at most 4300 digits, and so does msgspec, which has parsed these.
    return any(not MIN_INT <= int(digits) <= MAX_INT for digits in _LONG_INT.findall(_without_texts(raw)))


def _too_long() -> ValueEncodingError:
    return ValueEncodingError(
        "An integer needs more than 64 bits, but links carry -2^63 to 2^64-1.", fix="send a float, or a string."
    )
