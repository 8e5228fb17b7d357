"""Messages of a link: content of frames. UTF-8 JSON objects whose key "$" contains the type.

A page is exactly what `Page.serialize` returns, so its encoding for a link costs no more than recording it.

The head of a long page is read first. Data of a page that is not accepted are scanned and not decoded, which would take
50 ms for 1 MiB of empty lists.

Values have limits, in addition to the frame length: 64-bit integers, JSON nested 100 deep. Ordinary code fails beyond
them: an integer of 5000 digits has no `str`, one of 310 no `float`, and `repr` of a value that is nested 900 deep
overflows the stack. So such a value could end a component that is correct. A page may have 1000 numbers with exponents
of three digits. msgspec (0.22) takes 20 us to read one beyond 1e289 or below 1e-307, so 1 MB of them would stop all
threads of the program for 3 s.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import reduce
from operator import or_
from typing import Annotated, Any, NoReturn, TypeAlias

import msgspec
from msgspec.structs import replace

from snr_sim.prelude.errors import ValueEncodingError
from snr_sim.prelude.task import KINDS, Page, ensure_type_info
from snr_sim.prelude.values import LONG_BYTES, MAX_INT, MIN_INT, TAG, may_have_tags, no_garbage_collection, untag

PROTOCOL = "snr"
VERSION = 2
NONCE_BYTES = 16
MAX_NAME_CHARS = 200
MAX_REASON_CHARS = 1000
MAX_DEPTH = 100  # of nested objects and lists, including the message
MAX_LONG_EXPONENTS = 1000  # a lidar may report 360 times "nothing" as the largest float
# One character for all digits and signs, one kind of brackets for both.
_SHAPE = bytes.maketrans(b"123456789+-{}E", b"00000000000[]e")
_MIN_EXPONENTS_BYTES = 5 * MAX_LONG_EXPONENTS  # fewer bytes cannot contain more of them
_LONG_EXPONENT = re.compile(rb"[eE][+-]?[0-9]{3}")
_LONG_RUN = b"0" * len(str(-MIN_INT))  # fewer digits are always within the limits
_LONG_INT = re.compile(rb"(?<![0-9.eE+-])-?[0-9]{%d,}(?![0-9.eE])" % len(_LONG_RUN))
_MAX_INT_CHARS = len(str(MAX_INT))
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
_MARK = b'{"$":'  # the first in a page is its own
_OWN_INT_MARK = b'"$":"int"'
_OWN_OBJECT_MARK = b'"$":"object"'

Name: TypeAlias = Annotated[str, msgspec.Meta(min_length=1, max_length=MAX_NAME_CHARS)]
Hex16: TypeAlias = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]*$", min_length=32, max_length=32)]
Hex32: TypeAlias = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]*$", min_length=64, max_length=64)]
Reason: TypeAlias = Annotated[str, msgspec.Meta(max_length=MAX_REASON_CHARS)]


class HelloMessage(msgspec.Struct, frozen=True, tag_field=TAG, tag="hello"):
    """The first message of each end, sent at once. Fields that a version does not know are ignored.

    Args:
        protocol: "snr".
        version: of the protocol; both ends must have the same.
        node: name of the node.
        nonce: 16 random bytes in hexadecimal, new for each session, so that each has its own proofs and keys.
        purpose: "pages", or another protocol of the port; both ends must have the same.
        auth: whether this end has a shared secret and requires proof that the other has it too.
        max_frame_bytes: the longest payload this end takes.
    """

    protocol: Name
    version: Annotated[int, msgspec.Meta(ge=0, lt=2**32)]
    node: Name
    nonce: Hex16
    purpose: Name
    auth: bool
    max_frame_bytes: Annotated[int, msgspec.Meta(ge=1, lt=2**32)]


class Auth(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="auth"):
    """Proof that the sender knows the secret, which itself is never sent.

    Args:
        proof: HMAC-SHA256 in hexadecimal: see `derive_key` in `snr_sim/links/security.py`.
    """

    proof: Hex32


class Ping(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="ping"):
    """Keeps the link alive and requests a reply.

    Args:
        stamp_s: time of the sender.
    """

    stamp_s: float


class Pong(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="pong"):
    """The answer to a ping.

    Args:
        stamp_s: that of the ping.
    """

    stamp_s: float


class Bye(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="bye"):
    """The last message of an end that closes in good order.

    Args:
        reason: as text.
    """

    reason: Reason


class RefusedMessage(msgspec.Struct, frozen=True, tag_field=TAG, tag="refused"):
    """The last message of an end that rejects the other. Unknown fields are ignored.

    Args:
        reason: as text, with what to try.
    """

    reason: Reason


Control: TypeAlias = HelloMessage | Auth | Ping | Pong | Bye | RefusedMessage


class PageHead(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="page"):
    """A page whose data is checked but not decoded, which takes a fiftieth of the time."""

    key: str
    data: msgspec.Raw
    origin: str
    created_at_s: float
    process: bool = True


UNACCEPTABLE = Page("", None, "", 0.0, False)
encode_message: Callable[[Control], bytes] = msgspec.json.Encoder().encode
decode_control: Callable[[bytes], Control] = msgspec.json.Decoder(Control).decode
_decode: Callable[[bytes], Control | Page] = msgspec.json.Decoder(Control | Page).decode
_decode_head: Callable[[bytes], Control | PageHead] = msgspec.json.Decoder(Control | PageHead).decode


def decode_message(raw: bytes, is_acceptable: Callable[[str, str, bytes], bool] | None = None) -> Control | Page:
    """Return the message in a frame; `UNACCEPTABLE` in the place of a long page that is not acceptable.

    Args:
        is_acceptable: whether to accept a page of this key, origin and JSON. None accepts all.

    Raises:
        msgspec.DecodeError: it is not JSON, or none of these messages.
        ValueEncodingError: it is a page with damaged data, or beyond the limits of its values.
        RecursionError: it is nested too deeply.
    """
    if is_acceptable is not None and len(raw) >= LONG_BYTES:
        head = _decode_head(raw)
        if type(head) is PageHead and not is_acceptable(head.key, head.origin, raw):
            return UNACCEPTABLE
    check_bounds(raw)
    return (_decode_with_marks if len(raw) < LONG_BYTES else _decode_long)(raw)


def _decode_with_marks(raw: bytes) -> Control | Page:
    message = _decode(raw)
    if type(message) is Page and may_have_tags(raw, len(b'{"$')):  # other than its own, which usually comes first
        return replace(message, data=untag(message.data, WIRE_KINDS))
    return message


_decode_long: Callable[[bytes], Control | Page] = no_garbage_collection()(_decode_with_marks)


def decoder_of(*others: Any) -> Callable[[bytes], Any]:
    """Return a decoder of the control messages and of other tagged Structs: for sessions with another purpose."""
    kinds: Any = reduce(or_, others, Control)
    decode: Callable[[bytes], Any] = msgspec.json.Decoder(ensure_type_info(kinds)).decode
    return decode


def _refuse_int(**_fields: Any) -> NoReturn:
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
    # Of lists of numbers, counting one character takes a fifth of the time of counting four, and usually suffices.
    if len(raw) > _MIN_EXPONENTS_BYTES and shape.count(b"e") > MAX_LONG_EXPONENTS < shape.count(b"e000"):
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
    if len(raw) > _MIN_EXPONENTS_BYTES and len(_LONG_EXPONENT.findall(without_texts(raw))) > MAX_LONG_EXPONENTS:
        raise ValueEncodingError(
            f"More than {MAX_LONG_EXPONENTS} numbers are beyond 1e99 or below 1e-99.", fix="send them as a numpy array."
        )


def _too_long() -> ValueEncodingError:
    return ValueEncodingError(
        "An integer needs more than 64 bits, but links carry -2^63 to 2^64-1.", fix="send a float, or a string."
    )
