"""The schemas of links and consoles: all that is sent is valid, and what they refuse the code refuses, too."""

import json
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest

from snr_sim.console.parsing import CommandResult
from snr_sim.console.wire import (
    CommandMessage,
    CompleteMessage,
    Reply,
    decode_request,
    decode_response,
    encode_completions,
    encode_reply,
    encode_request,
    result_from_reply,
)
from snr_sim.links.frames import LengthPrefixedReader, encode_frame
from snr_sim.links.messages import decode_message
from snr_sim.links.session import Session, SessionConfig
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.task import Page

Validator = Callable[..., Callable[[Any], bool]]
SECRET = b"correct horse battery staple"


def session(is_server: bool = False, **config: Any) -> Session:
    return Session(SessionConfig("server_node" if is_server else "client_node", is_server, **config), now_s=0.0)


def talk(one: Session, other: Session) -> list[dict[str, Any]]:
    """Run two sessions until neither sends more; return all messages."""
    messages = []
    while frames := [(one, other, frame) for frame in one.take_output()] + [
        (other, one, frame) for frame in other.take_output()
    ]:
        for sender, to, frame in frames:
            messages.extend(json.loads(payload) for payload in LengthPrefixedReader().feed(frame))
            to.receive(sender.seal(frame), now_s=0.1)
    return messages


def conversations() -> Iterator[tuple[str, list[str], list[dict[str, Any]]]]:
    """Yields conversations: their names, the messages they should be made of, and the messages."""
    for name, secret in (("open", None), ("with a secret", SECRET)):
        one, other = session(secret=secret), session(True, secret=secret)
        messages = talk(one, other)
        one.tick(0.2)
        page = Page("k", {"tuple": (1, 2)}, "client_node", 0.5).serialize()
        other.receive(one.seal(encode_frame(page)), now_s=0.2)
        messages.append(json.loads(page))
        other.bye("done.")
        messages += talk(one, other)
        yield name, ["hello", "bye", "page", "ping", *(["auth"] if secret else [])], messages
    wrong: dict[str, dict[str, Any]] = {
        "another secret": {"secret": b"another secret than the server's"},
        "no secret": {},
        "another purpose": {"secret": SECRET, "purpose": "console"},
    }
    for name, config in wrong.items():
        yield name, ["hello", "refused"], talk(session(**config), session(True, secret=SECRET))
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


@pytest.mark.parametrize(("name", "kinds", "messages"), list(conversations()))
def test_all_sent_messages_are_valid(
    validator: Validator, name: str, kinds: list[str], messages: list[dict[str, Any]]
) -> None:
    assert {message["$"] for message in messages} >= set(kinds), messages
    assert [message for message in messages if not validator("wire")(message)] == []


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
            result_from_reply(taken)
    except (msgspec.DecodeError, SnrError):
        return False
    return True


def is_taken_by_a_console(message: Any) -> bool:
    return any(is_taken(message, decode) for decode in (decode_request, decode_response))


@pytest.mark.parametrize(
    ("message", "schema", "is_taken"),
    [
        *((message, "wire", is_taken) for message in MESSAGES),
        *((message, "console", is_taken_by_a_console) for message in [*MESSAGES[:6], *CONSOLE_MESSAGES]),
    ],
)
def test_code_and_schema_reject_the_same_damage(
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


def test_console_messages_are_valid(validator: Validator) -> None:
    answer = CommandResult("nan", data={"depth": float("nan")}, about="depth")
    frames = [
        encode_request(CommandMessage(1, "dump")),
        encode_request(CompleteMessage(2, "d")),
        encode_reply(1, answer),
        encode_completions(2, ["dump"]),
    ]
    messages = [json.loads(payload) for frame in frames for payload in LengthPrefixedReader().feed(frame)]
    assert [message["$"] for message in messages] == ["command", "complete", "reply", "words"]
    assert all(map(validator("console"), messages))


@pytest.mark.parametrize("kind", ["hello", "refused"])
def test_version_messages_accept_additional_fields(validator: Validator, kind: str) -> None:
    message = next(message for message in MESSAGES if message["$"] == kind) | {"since": "version 2"}
    assert validator("wire")(message)
    assert is_taken(message)
