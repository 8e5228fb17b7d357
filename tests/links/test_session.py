"""Two ends of a session, without a port: accepted and refused ends, with the reason. Hostile data is rejected."""

from __future__ import annotations

import tracemalloc
from typing import Any

import msgspec
import numpy  # noqa: F401 - here, so that its import does not count as time taken by a hostile array
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import Page
from snr_sim.links.frames import encode_frame
from snr_sim.links.messages import (
    LONG_BYTES,
    UNACCEPTABLE,
    Bye,
    HelloMessage,
    Ping,
    Pong,
    RefusedMessage,
    decode_message,
    encode_message,
)
from snr_sim.links.session import MAX_GREETING_BYTES, MAX_WAITING_BYTES, Session, SessionConfig, SessionState

from .conftest import hello

SECRET = b"sixteen or more bytes"


def ends(client: dict[str, Any] | None = None, server: dict[str, Any] | None = None) -> tuple[Session, Session]:
    """Return a client's and a server's session that have not exchanged data yet."""
    one = Session(SessionConfig("a_node", is_server=False, **(client or {})), 0.0, nonce=b"c" * 16)
    other = Session(SessionConfig("b_node", is_server=True, **(server or {})), 0.0, nonce=b"s" * 16)
    return one, other


def output_of(session: Session) -> bytes:
    """Return all bytes that a session has to send, as they are sent."""
    return b"".join(map(session.seal, session.take_output()))


def talk(one: Session, other: Session, now_s: float = 0.0) -> list[Any]:
    """Exchange the output of both until neither has any; return the pages that arrived."""
    came: list[Any] = []
    while True:
        there, back = output_of(one), output_of(other)
        if not there and not back:
            return came
        came += other.receive(there, now_s) + one.receive(back, now_s)


def greeted(**config: Any) -> Session:
    """Return a server's session that is up."""
    client, server = ends(config, config)
    talk(client, server)
    assert server.is_up
    return server


def send(session: Session, *payloads: bytes, now_s: float = 0.0) -> list[Any]:
    return session.receive(b"".join(encode_frame(payload, 1 << 30) for payload in payloads), now_s)


def last_word(session: Session) -> Any:
    """Return the last message that the session has to send."""
    return decode_message(session.take_output()[-1][4:])


def test_two_ends_come_up_with_each_others_names() -> None:
    client, server = ends()
    talk(client, server)
    assert (client.state, client.peer_node) == (SessionState.up, "b_node")
    assert (server.state, server.peer_node) == (SessionState.up, "a_node")


def test_two_ends_with_one_secret_come_up_and_never_send_it() -> None:
    client, server = ends({"secret": SECRET}, {"secret": SECRET})
    crossed = b""
    while not (client.is_up and server.is_up):
        there, back = output_of(client), output_of(server)
        assert there or back
        server.receive(there, 0.0)
        client.receive(back, 0.0)
        crossed += there + back
    assert SECRET not in crossed
    assert SECRET.hex().encode() not in crossed


def test_a_wrong_secret_is_refused_and_the_server_proves_nothing() -> None:
    client, server = ends({"secret": SECRET}, {"secret": SECRET + b"!"})
    server_output = b""
    for _ in range(3):
        server.receive(output_of(client), 0.0)
        answer = output_of(server)
        server_output += answer
        client.receive(answer, 0.0)
    assert not client.is_up
    assert not server.is_up
    assert "secrets of the two ends differ" in client.reason
    assert b'"auth","proof"' not in server_output.replace(b'"$":', b"")


@pytest.mark.parametrize("has_it", ["client", "server"])
def test_secret_on_one_end_only_is_refused_with_both_names(has_it: str) -> None:
    config = {"secret": SECRET}
    client, server = ends(config, None) if has_it == "client" else ends(None, config)
    talk(client, server)
    assert not client.is_up
    assert not server.is_up
    who, other = ("a_node", "b_node") if has_it == "client" else ("b_node", "a_node")
    assert f"node '{who}' asks for a shared secret, node '{other}' has none" in client.reason + server.reason


def test_reflected_proof_of_a_client_is_refused() -> None:
    # A false server without the secret returns the client's own nonce and proof.
    client = Session(SessionConfig("a_node", is_server=False, secret=SECRET), 0.0)
    own = decode_message(client.take_output()[0][4:])
    assert isinstance(own, HelloMessage)
    send(client, hello(nonce=own.nonce, auth=True))
    send(client, client.take_output()[0][4:])
    assert client.is_closed
    assert "differ" in client.reason


def test_proof_of_another_session_is_refused() -> None:
    client, server = ends({"secret": SECRET}, {"secret": SECRET})
    server_hello = output_of(server)
    client_hello = output_of(client)
    client.receive(server_hello, 0.0)
    server.receive(client_hello + (proof := output_of(client)), 0.0)
    assert server.is_up
    again = Session(SessionConfig("b_node", is_server=True, secret=SECRET), 0.0, nonce=b"t" * 16)
    again.receive(client_hello + proof, 0.0)
    assert again.is_closed


def test_another_version_is_refused_on_both_ends_with_both_numbers() -> None:
    _, server = ends()
    send(server, hello(version=1))
    assert server.is_closed
    assert server.was_refused
    assert "speaks snr version 2, the other end snr version 1. Try: the same release" in last_word(server).reason


def test_other_purpose_is_refused() -> None:
    client, server = ends({"purpose": "console"})
    talk(client, server)
    assert "node 'a_node' for console" in server.reason
    assert client.was_refused


def test_pages_keep_values_that_json_would_lose() -> None:
    server = greeted()
    pages = [Page("x", (1.0, float("inf")), "a_node", 0.5), Page("y", [1, 2], "a_node", 0.6, process=False)]
    assert send(server, *(page.serialize() for page in pages)) == pages


def test_long_page_not_accepted_is_left_out_and_must_be_valid() -> None:
    accepted, other = (Page(key, list(range(LONG_BYTES)), "a", 0.0, False) for key in ("wanted", "other"))

    def is_acceptable(key: str, origin: str, raw: bytes) -> bool:
        return (key, origin) == ("wanted", "a")

    assert decode_message(accepted.serialize(), is_acceptable) == accepted
    assert decode_message(other.serialize(), is_acceptable) is UNACCEPTABLE
    for damaged in (other.serialize()[:-2], other.serialize().replace(b"3,4", b"3;4", 1)):
        with pytest.raises(msgspec.DecodeError):
            decode_message(damaged, is_acceptable)


def test_a_page_before_the_greeting_is_refused() -> None:
    _, server = ends()
    assert send(server, Page("x", 1, "a_node", 0.0).serialize()) == []
    assert "before the greeting" in server.reason


def test_page_longer_than_a_greeting_is_accepted_after_hello() -> None:
    _, server = ends()
    page = Page("x", "y" * 10_000, "a_node", 0.0)
    assert send(server, hello(), page.serialize()) == [page]


def test_peer_before_hello_uses_only_the_memory_of_a_greeting() -> None:
    _, server = ends()
    server.receive((MAX_GREETING_BYTES + 1).to_bytes(4, "big"), 0.0)
    assert server.is_closed
    assert f"at most {MAX_GREETING_BYTES}" in server.reason


def test_silence_closes_the_session_and_pings_prevent_it() -> None:
    client, server = ends()
    talk(client, server)
    for tenth in range(100):
        now_s = tenth / 10
        client.tick(now_s)
        server.tick(now_s)
        talk(client, server, now_s)
    assert client.is_up
    assert server.is_up
    server.tick(server.last_received_s + 2.9)
    assert server.is_up
    server.tick(server.last_received_s + 3.1)
    assert server.is_closed
    assert server.reason == "nothing was heard for 3 s."  # plain: hear


def test_slow_greeting_is_closed_after_the_timeout() -> None:
    _, server = ends()
    for i, byte in enumerate(encode_frame(hello())):
        server.receive(bytes([byte]), i / 10)
        server.tick(i / 10)
    assert server.is_closed
    assert "greeting was not completed for 3 s" in server.reason


def test_greeting_timeout_may_exceed_the_silence_timeout() -> None:
    _, server = ends(None, {"greeting_s": float("inf")})
    server.tick(1e6)
    assert not server.is_closed


def test_half_a_frame_and_silence_closes_the_session() -> None:
    server = greeted()
    server.receive(encode_frame(b'{"$":"page"')[:9], 1.0)
    server.tick(3.9)
    assert server.is_up
    server.tick(4.1)
    assert server.is_closed


def test_rtt_equals_the_time_from_a_ping_to_its_own_answer() -> None:
    server = greeted()
    server.tick(1.0)
    assert last_word(server) == Ping(1.0)
    assert server.rtt_s == 0.0  # of the ping sent when it came up
    send(server, encode_message(Pong(0.5)), now_s=1.1)
    assert server.rtt_s == 0.0
    send(server, encode_message(Pong(1.0)), now_s=1.25)
    assert server.rtt_s == 0.25


def test_end_that_comes_up_sends_its_time_at_once() -> None:
    client, server = ends({"secret": SECRET}, {"secret": SECRET})
    for now_s in (1.0, 2.0):  # hello, then the client's proof
        for one, other in ((client, server), (server, client)):
            other.receive(output_of(one), now_s)
    assert server.is_up
    assert client.clock_offset_s is not None


def test_clock_offset_equals_that_of_the_quickest_recent_ping() -> None:
    session = greeted()
    for latency_s in (0.5, 0.1, 0.3):
        send(session, encode_message(Ping(100.0)), now_s=40.0 + latency_s)
    assert session.clock_offset_s == pytest.approx(-59.9)
    for _ in range(8):
        send(session, encode_message(Ping(100.0)), now_s=42.0)  # its clock was set back: earlier samples are dropped
    assert session.clock_offset_s == pytest.approx(-58.0)


def test_bye_closes_both_ends_with_its_reason() -> None:
    client, server = ends()
    talk(client, server)
    client.bye("dinner.")
    talk(client, server)
    assert server.reason == "'a_node' left: dinner."
    assert not server.was_refused


TAKES_OVER = "\x1b[2J\x1b]0;pwned\x07 ok\nlink_t is up: topside_node"


@pytest.mark.parametrize("message", [Bye(TAKES_OVER), RefusedMessage(TAKES_OVER)])
def test_reason_of_a_peer_is_printable_on_one_line(message: Bye | RefusedMessage) -> None:
    server = greeted()
    send(server, encode_message(message))
    assert server.is_closed
    assert server.reason.isprintable()
    assert "\\x1b[2J" in server.reason


@pytest.mark.parametrize(
    "payload",
    [
        hello(node=TAKES_OVER),
        hello(protocol=TAKES_OVER),
        hello(purpose=TAKES_OVER),
        msgspec.json.encode({"$": TAKES_OVER}),
        msgspec.json.encode({"$": "bye", "reason": "", TAKES_OVER: 1}),
    ],
)
def test_refusal_escapes_quoted_data(payload: bytes) -> None:
    _, server = ends()
    send(server, payload)
    assert server.was_refused
    assert server.reason.isprintable()
    assert last_word(server).reason == server.reason


def test_unprintable_node_name_is_refused_with_reason() -> None:
    _, server = ends()
    send(server, hello(node="a\x1b[2J"))
    assert "names itself 'a\\x1b[2J', with characters that no terminal shows. Try: " in last_word(server).reason


def test_peer_that_reads_no_answers_is_closed() -> None:
    server = greeted()
    for _ in range(MAX_WAITING_BYTES):
        send(server, encode_message(Ping(1.0)))
        if server.is_closed:
            break
    assert "does not read its answers" in server.reason


HOSTILE = {
    "HTTP": b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n",
    "a length of 4 GB": b"\xff\xff\xff\xff",
    "an empty frame": encode_frame(b""),
    "no JSON": encode_frame(b"\x00\x01\x02"),
    "JSON that is not a page": encode_frame(b"[1, 2, 3]"),
    "an object without a mark": encode_frame(b'{"key": "x"}'),
    "an unknown mark": encode_frame(b'{"$": "shutdown"}'),
    "a page without a key": encode_frame(b'{"$":"page","data":1,"origin":"a","created_at_s":0}'),
    "a page whose key is a number": encode_frame(b'{"$":"page","key":7,"data":1,"origin":"a","created_at_s":0}'),
    "NaN": encode_frame(b'{"$":"page","key":"x","data":NaN,"origin":"a","created_at_s":0}'),
    "a time of infinity": encode_frame(b'{"$":"page","key":"x","data":1,"origin":"a","created_at_s":1e999}'),
    "deep nesting": encode_frame(
        b'{"$":"page","key":"x","origin":"a","created_at_s":0,"data":' + b"[" * 100_000 + b"]" * 100_000 + b"}"
    ),
    "nested marks": encode_frame(
        b'{"$":"page","key":"x","origin":"a","created_at_s":0,"data":'
        + b'{"$":"tuple","v":[' * 900
        + b"]}" * 900
        + b"}"
    ),
    "invalid UTF-8": encode_frame(b'{"$":"page","key":"\xff\xfe","data":1,"origin":"a","created_at_s":0}'),
    "an object that cannot be brought back": encode_frame(
        b'{"$":"page","key":"x","origin":"a","created_at_s":0,"data":{"$":"object","type":"os.system","fields":{}}}'
    ),
    "an array of a terabyte": encode_frame(
        b'{"$":"page","key":"x","origin":"a","created_at_s":0,'
        b'"data":{"$":"array","dtype":"S1000000000","shape":[1],"data":["a"]}}'
    ),
    "a second hello": encode_frame(hello()),
    "a reason of a megabyte": encode_frame(encode_message(Bye("x" * 1_000_000))),
}


@pytest.mark.parametrize("what", HOSTILE)
@pytest.mark.parametrize("when", ["first", "once up"])
def test_invalid_data_closes_the_session_and_uses_no_memory(what: str, when: str) -> None:
    server = greeted() if when == "once up" else ends()[1]
    if when == "first" and what == "a second hello":
        send(server, hello())
    server.take_output()
    tracemalloc.start()
    pages = server.receive(HOSTILE[what], 0.0)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert pages == []
    assert server.is_closed
    assert server.reason
    assert isinstance(last_word(server), RefusedMessage)
    assert peak_bytes < 20 * len(HOSTILE[what]) + 2_000_000


def test_closed_session_ignores_data() -> None:
    server = greeted()
    server.refuse("no.")
    assert send(server, Page("x", 1, "a_node", 0.0).serialize()) == []


pieces = st.one_of(
    st.binary(max_size=64),
    st.binary(max_size=64).map(encode_frame),
    st.recursive(
        st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=8),
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.dictionaries(
                st.sampled_from(["$", "v", "key", "data", "dtype", "shape", "b64", "type", "fields"]), inner, max_size=6
            )
        ),
        max_leaves=20,
    ).map(lambda value: encode_frame(msgspec.json.encode(value))),
    st.builds(
        lambda mark, value: encode_frame(
            msgspec.json.encode(
                {"$": "page", "key": "x", "origin": "o", "created_at_s": 0, "data": {"$": mark, "v": value}}
            )
        ),
        st.sampled_from(["tuple", "set", "dict", "bytes", "int", "float", "array", "page", "object", "odd"]),
        st.one_of(st.text(max_size=5), st.integers(), st.lists(st.lists(st.integers(), max_size=3), max_size=3)),
    ),
    st.sampled_from([encode_frame(encode_message(Ping(1.0))), encode_frame(hello()), *HOSTILE.values()]),
)


@given(st.booleans(), st.lists(pieces, max_size=8), st.lists(st.integers(1, 50), min_size=1, max_size=5))
def test_random_bytes_never_raise_and_return_only_pages(is_up: bool, parts: list[bytes], cuts: list[int]) -> None:
    server = greeted() if is_up else ends()[1]
    stream, start = b"".join(parts), 0
    for i in range(60):
        stop = len(stream) if i == 59 else start + cuts[i % len(cuts)]
        for page in server.receive(stream[start:stop], 0.0):
            assert type(page) is Page
            assert type(page.key) is str
        start = stop
    server.tick(100.0)
    assert server.is_closed
    assert server.reason


def test_end_that_did_not_read_waits_for_the_other_and_has_not_received_more() -> None:
    """A busy end that reads again must not take a silent session for an active one: see `Peers`, same names."""
    server = greeted(timeout_s=1.0)
    server.receive(b"", 2.0)
    server.reset_idle_timer(5.0)
    assert server.last_received_s == 2.0
    server.tick(5.9)
    assert server.is_up
    server.tick(6.1)
    assert server.is_closed


def test_data_that_is_read_late_does_not_make_a_session_steady() -> None:
    """What a node had sent before it reconnected may be read after that, at once; it is not a second node."""
    server = greeted(keep_alive_s=0.05)
    for late_s in (11.5, 11.501, 11.502, 11.503, 11.504):
        server.receive(b"", late_s)
    assert not server.is_received_steadily(10.0)
    for time_s in (11.6, 11.65, 11.7):
        server.receive(b"", time_s)
    assert server.is_received_steadily(10.0)
    assert not server.is_received_steadily(11.55)
