"""Messages of a link: content of frames. UTF-8 JSON objects whose key "$" contains the type.

A page is exactly what `Page.serialize` returns, so its encoding for a link costs no more than recording it.

The head of a long page is read first. Data of a page that is not accepted are scanned and not decoded, which would take
50 ms for 1 MiB of empty lists.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from operator import or_
from typing import Annotated, Any, TypeAlias

import msgspec
from msgspec.structs import replace

from snr_sim.links.wire_bounds import WIRE_KINDS, check_bounds
from snr_sim.prelude.task import Page, ensure_type_info
from snr_sim.prelude.values import LONG_BYTES, TAG, may_have_tags, no_garbage_collection, untag

PROTOCOL = "snr"
VERSION = 2
NONCE_BYTES = 16
MAX_NAME_CHARS = 200
MAX_REASON_CHARS = 1000

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
        ValueEncodingError: it is a page with damaged data, or beyond the bounds of wire_bounds.py.
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
