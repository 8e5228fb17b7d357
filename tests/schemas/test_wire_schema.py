"""The schema of links: all that sessions send is valid, and what it refuses they refuse, too."""

import json
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest

from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.page import Page
from snr_sim.std_mods.comms.frames import FrameReader, encode_frame
from snr_sim.std_mods.comms.messages import decode_message
from snr_sim.std_mods.comms.session import Session, Terms

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
        for _, to, frame in frames:
            said.extend(json.loads(payload) for payload in FrameReader().feed(frame))
            to.receive(frame, now_s=0.1)
    return said


def conversations() -> Iterator[tuple[str, list[str], list[dict[str, Any]]]]:
    """Yields conversations: their names, the messages they should be made of, and the messages."""
    for name, secret in (("open", None), ("with a secret", SECRET)):
        one, other = session(secret=secret), session(True, secret=secret)
        said = talk(one, other)
        one.tick(0.2)
        one.send(Page("k", {"tuple": (1, 2)}, "client_node", 0.5).serialize())
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
    {"$": "hello", "protocol": "snr", "version": 1, "node": "n", "nonce": "0" * 32, "purpose": "pages", "auth": False,
     "max_frame_bytes": 1},
    {"$": "auth", "proof": "0" * 64},
    {"$": "ping", "stamp_s": 0.5},
    {"$": "pong", "stamp_s": 1},
    {"$": "bye", "reason": ""},
    {"$": "refused", "reason": "x" * 1000},
    {"$": "page", "key": "k", "data": [1], "origin": "n", "created_at_s": 0.5, "process": True},
    {"$": "page", "key": "k", "data": {"$": "tuple", "v": [1]}, "origin": "n", "created_at_s": 0.5},
]  # fmt: skip
OTHERS: list[Any] = [
    None, True, -1, 0, 2**32, 1.5, "", "x", "0" * 32 + "\n", "A" * 32, "x" * 201, "x" * 1001, [], {}, {"$": "x"}
]  # fmt: skip


def is_taken(message: Any) -> bool:
    try:
        decode_message(json.dumps(message).encode())
    except (msgspec.DecodeError, SnrError):
        return False
    return True


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message["$"])
def test_code_and_schema_refuse_the_same_damages(validator: Validator, message: dict[str, Any]) -> None:
    is_valid = validator("wire")
    assert is_valid(message)
    assert is_taken(message)
    mutants = [{key: value for key, value in message.items() if key != field} for field in message]
    mutants += [message | {field: other} for field in message for other in OTHERS]
    mutants += [message | {"more": 1}, [message], json.dumps(message)]
    verdicts = [(mutant, is_taken(mutant), is_valid(mutant)) for mutant in mutants]
    assert [verdict for verdict in verdicts if verdict[1] != verdict[2]] == []
    assert sum(not taken for _, taken, _ in verdicts) > 10


@pytest.mark.parametrize("kind", ["hello", "refused"])
def test_what_tells_ends_of_two_versions_apart_may_have_fields_more(validator: Validator, kind: str) -> None:
    message = next(message for message in MESSAGES if message["$"] == kind) | {"since": "version 2"}
    assert validator("wire")(message)
    assert is_taken(message)
