"""Messages between consoles and nodes, once a session of `links/session.py` is up between them.

Frames, greeting, proof of the token and keep-alive are those of links; only the purpose differs. A token is never
sent: both ends prove that they know it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Annotated, TypeAlias

import msgspec

from snr_sim.console.parsing import MAX_LINE_CHARS, CommandResult
from snr_sim.links.frames import MAX_FRAME_BYTES, encode_frame
from snr_sim.links.messages import WIRE_KINDS, check_bounds, decoder_of
from snr_sim.prelude.values import TAG, decode_value, encode_value

SECRET_IS = ("token", "the node's token, by --token-file FILE or the variable SNR_TOKEN; in a program by token=")
PURPOSE = "console"
DEFAULT_PORT = 54321
READ_BYTES = 1 << 14
MAX_LINE_FRAME_BYTES = 8 * MAX_LINE_CHARS  # six bytes at most for a character in JSON, plus the message around them

Number: TypeAlias = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
Line: TypeAlias = Annotated[str, msgspec.Meta(max_length=MAX_LINE_CHARS)]
Value: TypeAlias = Annotated[msgspec.Raw, msgspec.Meta(extra_json_schema={"$ref": "value.schema.json"})]


class CommandMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="command"):
    """A line to execute; a Reply with the same number follows."""

    number: Number
    line: Line


class CompleteMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="complete"):
    """A line to complete; CompletionsMessage with the same number follows."""

    number: Number
    line: Line


class Reply(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="reply"):
    """An answer; number 0 marks that of a watched page, sent without a request."""

    number: Number
    text: str
    data: Value
    is_error: bool
    about: str


class CompletionsMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="words"):
    """CompletionsMessage that can follow at the end of a line."""

    number: Number
    words: list[str]


Request: TypeAlias = CommandMessage | CompleteMessage
Response: TypeAlias = Reply | CompletionsMessage
decode_request: Callable[[bytes], Request] = decoder_of(CommandMessage, CompleteMessage)
decode_response: Callable[[bytes], Response] = decoder_of(Reply, CompletionsMessage)
_encode = msgspec.json.Encoder().encode


def encode_request(message: Request) -> bytes:
    """Return the frame of a request."""
    return encode_frame(_encode(message), MAX_LINE_FRAME_BYTES)


def encode_reply(number: int, answer: CommandResult) -> bytes:
    """Return the frame of an answer; without its data if both together exceed the size of a frame."""
    for data in (answer.data, None):
        reply = Reply(number, answer.text, msgspec.Raw(encode_value(data)), answer.is_error, answer.about)
        payload = _encode(reply)
        if len(payload) <= MAX_FRAME_BYTES:
            break
    return encode_frame(payload)


def encode_completions(number: int, words: list[str]) -> bytes:
    """Return the frame of a completion."""
    return encode_frame(_encode(CompletionsMessage(number, words)))


def result_from_reply(reply: Reply) -> CommandResult:
    """Return the answer in a reply; raise ValueEncodingError if its data is damaged, or beyond the limits."""
    raw = bytes(reply.data)
    check_bounds(raw)
    return CommandResult(reply.text, decode_value(raw, WIRE_KINDS), reply.is_error, reply.about)


async def read_for(reader: asyncio.StreamReader, timeout_s: float) -> bytes | None:
    """Return what has arrived, b"" at the end; None if nothing has within the time limit. Raise OSError if it broke."""
    try:
        async with asyncio.timeout(timeout_s):
            return await reader.read(READ_BYTES)
    except TimeoutError:
        if reader.exception() is not None:  # a time-out of the network, not of this wait
            raise
        return None
