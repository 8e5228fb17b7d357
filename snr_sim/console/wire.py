"""Messages between consoles and nodes, once a session of `comms/session.py` is up between them.

Frames, greeting, proof of the token and keep-alive are those of links; only the purpose differs. A token is never
sent: both ends prove that they know it.
"""

from __future__ import annotations

import asyncio
from typing import Annotated, Any, TypeAlias

import msgspec

from snr_sim.console.table import Answer
from snr_sim.console.words import LINE_MAX_CHARS
from snr_sim.links.frames import MAX_FRAME_BYTES, encode_frame
from snr_sim.links.messages import decoder_of
from snr_sim.links.wire_bounds import WIRE_KINDS, check_bounds
from snr_sim.prelude.values import MARK, decode_value, encode_value

SECRET_IS = ("token", "the node's token, by --token-file FILE or the variable SNR_TOKEN; in a program by token=")
PURPOSE = "console"
DEFAULT_PORT = 54321
READ_BYTES = 1 << 14
LINE_FRAME_MAX_BYTES = 8 * LINE_MAX_CHARS  # six bytes at most for a character in JSON, plus the message around them

Number: TypeAlias = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
Line: TypeAlias = Annotated[str, msgspec.Meta(max_length=LINE_MAX_CHARS)]
Value: TypeAlias = Annotated[msgspec.Raw, msgspec.Meta(extra_json_schema={"$ref": "value.schema.json"})]


class Command(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=MARK, tag="command"):
    """A line to execute; a Reply with the same number follows."""

    number: Number
    line: Line


class Complete(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=MARK, tag="complete"):
    """A line to complete; Words with the same number follow."""

    number: Number
    line: Line


class Reply(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=MARK, tag="reply"):
    """An answer; number 0 marks that of a watched page, sent without a request."""

    number: Number
    text: str
    data: Value
    is_error: bool
    about: str


class Words(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=MARK, tag="words"):
    """Words that can follow at the end of a line."""

    number: Number
    words: list[str]


decode_asked = decoder_of(Command, Complete)
decode_answered = decoder_of(Reply, Words)
_encode = msgspec.json.Encoder().encode


def asked(message: Command | Complete) -> bytes:
    """Return the frame of a request."""
    return encode_frame(_encode(message), LINE_FRAME_MAX_BYTES)


def replied(number: int, answer: Answer) -> bytes:
    """Return the frame of an answer; without its data if both together exceed the size of a frame."""
    for data in (answer.data, None):
        reply = Reply(number, answer.text, msgspec.Raw(encode_value(data)), answer.is_error, answer.about)
        payload = _encode(reply)
        if len(payload) <= MAX_FRAME_BYTES:
            break
    return encode_frame(payload)


def completed(number: int, words: list[str]) -> bytes:
    """Return the frame of a completion."""
    return encode_frame(_encode(Words(number, words)))


def answer_of(reply: Reply) -> Answer:
    """Return the answer in a reply.

    Raises:
        ValueEncodingError: its data is damaged, or beyond the limits of `comms/wire_bounds.py`.
    """
    raw = bytes(reply.data)
    data: Any = decode_value(raw, WIRE_KINDS)
    check_bounds(raw)
    return Answer(reply.text, data, reply.is_error, reply.about)


async def read_for(reader: asyncio.StreamReader, timeout_s: float) -> bytes | None:
    """Return what has arrived, b"" at the end; None if nothing has within the time limit.

    Raises:
        OSError: the connection broke.
    """
    try:
        async with asyncio.timeout(timeout_s):
            return await reader.read(READ_BYTES)
    except TimeoutError:
        if reader.exception() is not None:  # a time-out of the network, not of this wait
            raise
        return None
