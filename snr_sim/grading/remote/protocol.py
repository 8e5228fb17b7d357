"""What the grader and the student's process say to each other: one line of JSON each way, the grader asks first.

    --> {"n": 7, "do": "call", "args": {"file": "mixer.py", "function": "mix", "args": [0.5]}}
    <-- {"n": 7, "value": [1500, 1550]}      or      {"n": 7, "error": {"step": "call", "text": "mixer.py, line 3: "}}

What comes back is a stranger's: a line has a longest length, nothing in it is nested deeply, and of JSON nothing can
come but numbers, texts, lists, dicts, true, false and nothing. So no object of the student's class, whatever it
says that it equals, ever stands in the grader.
"""

from __future__ import annotations

from typing import Any, TypeVar

import msgspec

from snr_sim.prelude.errors import SnrError, ValueEncodingError
from snr_sim.prelude.values import NO_JSON, decode_value

MAX_ANSWER_BYTES = 1 << 20
MAX_DEPTH = 32
PIPES = -1  # in place of a descriptor: the process is asked on its stdin and answers on its stdout
TIME_UP_STATUS = 152  # exit status of a process whose CPU time is up, as a shell tells SIGXCPU


class Ask(msgspec.Struct, frozen=True):
    """What the grader says.

    Args:
        n: the number of the line.
        do: which of the child's verbs.
        args: for that.
        cpu_s: how much CPU time the answer may take.
    """

    n: int
    do: str
    args: Any
    cpu_s: float


class Asked(msgspec.Struct, frozen=True):
    """The same as the child hears it: the arguments are for the verb to read."""

    n: int
    do: str
    args: msgspec.Raw
    cpu_s: float


class Said(msgspec.Struct, frozen=True, omit_defaults=True):
    """A failure of the student's program, in the words of its own process.

    Args:
        step: what was tried: "load", "call", "handle", ...
        text: with the student's line first.
        fix: what to try.
        component: whose it was.
        is_value: what came back is no value that can cross, rather than that something was raised.
        is_refused: what the program has or gives is not what the kit takes, and `text` says so.
    """

    step: str
    text: str
    fix: str = ""
    component: str = ""
    is_value: bool = False
    is_refused: bool = False


class Answer(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What the student's process says: a value, or why there is none.

    Args:
        n: the number of the line that is answered.
        value: JSON, of the form that was asked for.
        error: what went wrong.
    """

    n: int
    value: msgspec.Raw = msgspec.Raw(b"null")
    error: Said | None = None


class ProtocolError(SnrError):
    """A line that is not what the protocol allows."""


encode = msgspec.json.Encoder().encode
decode_ask = msgspec.json.Decoder(Asked).decode
_decode_answer = msgspec.json.Decoder(Answer).decode
T = TypeVar("T")


def decode_answer(line: bytes | bytearray) -> Answer:
    """Returns the answer in a line.

    Raises:
        ProtocolError: there is none.
    """
    try:
        return _decode_answer(line)
    except NO_JSON as error:
        raise ProtocolError(f"It answered with something that is no answer: {error}.") from error


def decode_as(decoder: msgspec.json.Decoder[T], raw: msgspec.Raw) -> T:
    """Returns a value of a known form.

    Raises:
        ProtocolError: it has another one.
    """
    check_depth(bytes(raw))
    try:
        return decoder.decode(raw)
    except NO_JSON as error:
        raise ProtocolError(f"It answered with something that is no answer: {error}.") from error


def plain_value(raw: msgspec.Raw) -> Any:
    """Returns a value of plain JSON; a number that is not finite is one, too.

    Raises:
        ProtocolError: it is nested too deeply, or no such value.
    """
    data = bytes(raw)
    check_depth(data)
    try:
        return decode_value(data)
    except ValueEncodingError as error:
        raise ProtocolError(f"It answered with something that is no value: {error.message}") from error


def check_depth(data: bytes) -> None:
    """Checks that JSON is not nested too deeply for whoever walks through it later.

    Raises:
        ProtocolError: it is.
    """
    if data.count(b"[") + data.count(b"{") <= MAX_DEPTH:
        return
    depth = deepest = 0
    for byte in _without_texts(data):
        if byte in b"[{":
            depth += 1
            deepest = max(deepest, depth)
        elif byte in b"]}":
            depth -= 1
    if deepest > MAX_DEPTH:
        raise ProtocolError(f"It answered with lists in lists {deepest} deep.")


_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))


def _without_texts(data: bytes) -> bytes:
    """Returns the brackets that are not in texts."""
    if b'"' not in data:
        return data.translate(None, _NO_BRACKETS)
    parts = data.replace(b"\\\\", b"").replace(b'\\"', b"").split(b'"')
    return b"".join(parts[::2]).translate(None, _NO_BRACKETS)
