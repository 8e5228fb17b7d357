"""The schemas of links and consoles: all that is sent is valid, and what they refuse the code refuses, too."""

import json
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest

from snr_sim.console.table import Answer
from snr_sim.console.wire import (
    Command,
    Complete,
    Reply,
    answer_of,
    asked,
    completed,
    decode_answered,
    decode_asked,
    replied,
)
from snr_sim.links.frames import FrameReader, encode_frame
from snr_sim.links.messages import decode_message
from snr_sim.links.session import Session, Terms
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.page import Page

Validator = Callable[..., Callable[[Any], bool]]
SECRET = b"correct horse battery staple"


def session(is_server: bool = False, **terms: Any) -> Session:
    return Session(Terms("server_node" if is_server else "client_node", is_server, **terms), now_s=0.0)


def talk(one: Session, other: Session) -> list[dict[str, Any]]:
    """Has two sessions talk until neither says more; returns all that was said."""
    said = []
    while frames := [(one, other, frame) for frame in one.take_output()] + [
        (other, one, frame) for frame in other.take_output()
    ]:
        for sender, to, frame in frames:
            said.extend(json.loads(payload) for payload in FrameReader().feed(frame))
            to.receive(sender.seal(frame), now_s=0.1)
    return said


def conversations() -> Iterator[tuple[str, list[str], list[dict[str, Any]]]]:
    """Yields conversations: their names, the messages they should be made of, and the messages."""
    for name, secret in (("open", None), ("with a secret", SECRET)):
        one, other = session(secret=secret), session(True, secret=secret)
        said = talk(one, other)
        one.tick(0.2)
        page = Page("k", {"tuple": (1, 2)}, "client_node", 0.5).serialize()
        other.receive(one.seal(encode_frame(page)), now_s=0.2)
        said.append(json.loads(page))
        other.bye("done.")
        said += talk(one, other)
        yield name, ["hello", "bye", "page", "ping", *(["auth"] if secret else [])], said
    wrong: dict[str, dict[str, Any]] = {
        "another secret": {"secret": b"another secret than the server's"},
        "no secret": {},
        "another purpose": {"secret": SECRET, "purpose": "console"},
    }
    for name, terms in wrong.items():
        yield name, ["hello", "refused"], talk(session(**terms), session(True, secret=SECRET))
    hostile = {
        "HTTP": b"GET / HTTP/1.1\r\nHost: rov\r\n\r\n",
        "4 GB": b"\xff\xff\xff\xff",
        "no JSON": encode_frame(b"{"),
        "nothing": encode_frame(b""),
        "JSON": encode_frame(b"[1]"),
        "a page too soon": encode_frame(Page("k", 1, "n", 0.0).serialize()),
        "a ping too soon": encode_frame(b'{"$":"ping","stamp_s":1}'),
        "a long reason": encode_frame(b'{"$":"' + b"x" * 3000 + b'"}'),
    }
    for name, data in hostile.items():
        server = session(True)
        server.receive(data, now_s=0.1)
        yield name, ["hello", "refused"], talk(session(), server)


@pytest.mark.parametrize(("name", "kinds", "said"), list(conversations()))
def test_all_that_is_said_is_valid(
    validator: Validator, name: str, kinds: list[str], said: list[dict[str, Any]]
) -> None:
    assert {message["$"] for message in said} >= set(kinds), said
    assert [message for message in said if not validator("wire")(message)] == []


MESSAGES: list[dict[str, Any]] = [
    {"$": "hello", "protocol": "snr", "version": 2, "node": "n", "nonce": "0" * 32, "purpose": "pages", "auth": False,
     "max_frame_bytes": 1},
    {"$": "auth", "proof": "0" * 64},
    {"$": "ping", "stamp_s": 0.5},
    {"$": "pong", "stamp_s": 1},
    {"$": "bye", "reason": ""},
    {"$": "refused", "reason": "x" * 1000},
    {"$": "page", "key": "k", "data": [1], "origin": "n", "created_at_s": 0.5, "process": True},
    {"$": "page", "key": "k", "data": {"$": "tuple", "v": [1]}, "origin": "n", "created_at_s": 0.5},
]  # fmt: skip
CONSOLE_MESSAGES: list[dict[str, Any]] = [
    {"$": "command", "number": 1, "line": "dump depth"},
    {"$": "complete", "number": 2, "line": "du"},
    {"$": "reply", "number": 1, "text": "1.5", "data": {"$": "tuple", "v": [1]}, "is_error": False, "about": "depth"},
    {
        "$": "reply",
        "number": 0,
        "text": "",
        "data": {"$": "page", "key": "k", "data": 1, "origin": "n", "created_at_s": 0.5},
        "is_error": True,
        "about": "",
    },
    {"$": "words", "number": 2, "words": ["dump"]},
]
OTHERS: list[Any] = [
    None, True, -1, 0, 2**32, 1.5, "", "x", "0" * 32 + "\n", "A" * 32, "x" * 201, "x" * 1001, [], {}, {"$": "x"}
]  # fmt: skip


def is_taken(message: Any, decode: Callable[[bytes], Any] = decode_message) -> bool:
    try:
        taken = decode(json.dumps(message).encode())
        if isinstance(taken, Reply):
            answer_of(taken)
    except (msgspec.DecodeError, SnrError):
        return False
    return True


def is_taken_by_a_console(message: Any) -> bool:
    return any(is_taken(message, decode) for decode in (decode_asked, decode_answered))


@pytest.mark.parametrize(
    ("message", "schema", "is_taken"),
    [
        *((message, "wire", is_taken) for message in MESSAGES),
        *((message, "console", is_taken_by_a_console) for message in [*MESSAGES[:6], *CONSOLE_MESSAGES]),
    ],
)
def test_code_and_schema_refuse_the_same_damages(
    validator: Validator, message: dict[str, Any], schema: str, is_taken: Callable[[Any], bool]
) -> None:
    is_valid = validator(schema)
    assert is_valid(message)
    assert is_taken(message)
    mutants = [{key: value for key, value in message.items() if key != field} for field in message]
    mutants += [message | {field: other} for field in message for other in OTHERS]
    mutants += [message | {"more": 1}, [message], json.dumps(message)]
    verdicts = [(mutant, is_taken(mutant), is_valid(mutant)) for mutant in mutants]
    assert [verdict for verdict in verdicts if verdict[1] != verdict[2]] == []
    assert sum(not taken for _, taken, _ in verdicts) > 10


def test_what_a_console_and_a_node_say_is_valid(validator: Validator) -> None:
    answer = Answer("nan", data={"depth": float("nan")}, about="depth")
    frames = [asked(Command(1, "dump")), asked(Complete(2, "d")), replied(1, answer), completed(2, ["dump"])]
    said = [json.loads(payload) for frame in frames for payload in FrameReader().feed(frame)]
    assert [message["$"] for message in said] == ["command", "complete", "reply", "words"]
    assert all(map(validator("console"), said))


@pytest.mark.parametrize("kind", ["hello", "refused"])
def test_what_tells_ends_of_two_versions_apart_may_have_fields_more(validator: Validator, kind: str) -> None:
    message = next(message for message in MESSAGES if message["$"] == kind) | {"since": "version 2"}
    assert validator("wire")(message)
    assert is_taken(message)
