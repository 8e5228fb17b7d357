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
from snr_sim.links.messages import LONG_BYTES, Bye, Hello, Ping, Pong, Refused, decode_message, encode_message
from snr_sim.links.session import MAX_GREETING_BYTES, MAX_WAITING_BYTES, Session, State, Terms

from .conftest import hello

SECRET = b"sixteen or more bytes"


def ends(client: dict[str, Any] | None = None, server: dict[str, Any] | None = None) -> tuple[Session, Session]:
    """Return a client's and a server's session that have not exchanged data yet."""
    one = Session(Terms("a_node", is_server=False, **(client or {})), 0.0, nonce=b"c" * 16)
    other = Session(Terms("b_node", is_server=True, **(server or {})), 0.0, nonce=b"s" * 16)
    return one, other


def said_by(session: Session) -> bytes:
    """Return all bytes that a session has to send, as they are sent."""
    return b"".join(map(session.seal, session.take_output()))


def talk(one: Session, other: Session, now_s: float = 0.0) -> list[Any]:
    """Exchange the output of both until neither has any; return the pages that arrived."""
    came: list[Any] = []
    while True:
        there, back = said_by(one), said_by(other)
        if not there and not back:
            return came
        came += other.receive(there, now_s) + one.receive(back, now_s)


def greeted(**terms: Any) -> Session:
    """Return a server's session that is up."""
    client, server = ends(terms, terms)
    talk(client, server)
    assert server.is_up
    return server


def say(session: Session, *payloads: bytes, now_s: float = 0.0) -> list[Any]:
    return session.receive(b"".join(encode_frame(payload, 1 << 30) for payload in payloads), now_s)


def last_word(session: Session) -> Any:
    """Return the last message that the session has to send."""
    return decode_message(session.take_output()[-1][4:])


def test_two_ends_come_up_and_know_each_other() -> None:
    client, server = ends()
    talk(client, server)
    assert (client.state, client.peer_node) == (State.up, "b_node")
    assert (server.state, server.peer_node) == (State.up, "a_node")


def test_two_ends_with_one_secret_come_up_and_the_secret_never_crosses() -> None:
    client, server = ends({"secret": SECRET}, {"secret": SECRET})
    crossed = b""
    while not (client.is_up and server.is_up):
        there, back = said_by(client), said_by(server)
        assert there or back
        server.receive(there, 0.0)
        client.receive(back, 0.0)
        crossed += there + back
    assert SECRET not in crossed
    assert SECRET.hex().encode() not in crossed


def test_a_wrong_secret_is_refused_and_the_server_proves_nothing() -> None:
    client, server = ends({"secret": SECRET}, {"secret": SECRET + b"!"})
    said_by_server = b""
    for _ in range(3):
        server.receive(said_by(client), 0.0)
        answer = said_by(server)
        said_by_server += answer
        client.receive(answer, 0.0)
    assert not client.is_up
    assert not server.is_up
    assert "secrets of the two ends differ" in client.reason
    assert b'"auth","proof"' not in said_by_server.replace(b'"$":', b"")


@pytest.mark.parametrize("has_it", ["client", "server"])
def test_a_secret_on_one_end_only_is_refused_by_name(has_it: str) -> None:
    terms = {"secret": SECRET}
    client, server = ends(terms, None) if has_it == "client" else ends(None, terms)
    talk(client, server)
    assert not client.is_up
    assert not server.is_up
    who, other = ("a_node", "b_node") if has_it == "client" else ("b_node", "a_node")
    assert f"node '{who}' asks for a shared secret, node '{other}' has none" in client.reason + server.reason


def test_what_a_client_proved_cannot_be_said_back_to_it() -> None:
    # A false server without the secret returns the client's own nonce and proof.
    client = Session(Terms("a_node", is_server=False, secret=SECRET), 0.0)
    own = decode_message(client.take_output()[0][4:])
    assert isinstance(own, Hello)
    say(client, hello(nonce=own.nonce, auth=True))
    say(client, client.take_output()[0][4:])
    assert client.is_closed
    assert "differ" in client.reason


def test_a_proof_of_another_session_is_worth_nothing() -> None:
    client, server = ends({"secret": SECRET}, {"secret": SECRET})
    server_says = said_by(server)
    client_says = said_by(client)
    client.receive(server_says, 0.0)
    server.receive(client_says + (proof := said_by(client)), 0.0)
    assert server.is_up
    again = Session(Terms("b_node", is_server=True, secret=SECRET), 0.0, nonce=b"t" * 16)
    again.receive(client_says + proof, 0.0)
    assert again.is_closed


def test_another_version_is_refused_on_both_ends_with_both_numbers() -> None:
    _, server = ends()
    say(server, hello(version=1))
    assert server.is_closed
    assert server.was_refused
    assert "speaks snr version 2, the other end snr version 1. Try: the same release" in last_word(server).reason


def test_a_port_for_pages_is_not_one_for_consoles() -> None:
    client, server = ends({"purpose": "console"})
    talk(client, server)
    assert "node 'a_node' for console" in server.reason
    assert client.was_refused


def test_pages_cross_once_both_are_up_and_keep_what_json_would_lose() -> None:
    server = greeted()
    pages = [Page("x", (1.0, float("inf")), "a_node", 0.5), Page("y", [1, 2], "a_node", 0.6, process=False)]
    assert say(server, *(page.serialize() for page in pages)) == pages
    assert server.received == 2


def test_a_long_page_that_is_not_wanted_comes_without_its_data_and_must_still_be_one() -> None:
    wanted, other = (Page(key, list(range(LONG_BYTES)), "a", 0.0, False) for key in ("wanted", "other"))

    def is_wanted(key: str, origin: str) -> bool:
        return (key, origin) == ("wanted", "a")

    assert decode_message(wanted.serialize(), is_wanted) == wanted
    assert decode_message(other.serialize(), is_wanted) == Page("other", None, "a", 0.0, False)
    for damaged in (other.serialize()[:-2], other.serialize().replace(b"3,4", b"3;4", 1)):
        with pytest.raises(msgspec.DecodeError):
            decode_message(damaged, is_wanted)


def test_a_page_before_the_greeting_is_refused() -> None:
    _, server = ends()
    assert say(server, Page("x", 1, "a_node", 0.0).serialize()) == []
    assert "before the greeting" in server.reason


def test_a_page_right_behind_the_hello_is_taken_even_if_it_is_longer_than_a_greeting_may_be() -> None:
    _, server = ends()
    page = Page("x", "y" * 10_000, "a_node", 0.0)
    assert say(server, hello(), page.serialize()) == [page]


def test_who_has_not_said_hello_gets_no_more_memory_than_a_greeting_needs() -> None:
    _, server = ends()
    server.receive((MAX_GREETING_BYTES + 1).to_bytes(4, "big"), 0.0)
    assert server.is_closed
    assert f"at most {MAX_GREETING_BYTES}" in server.reason


def test_silence_is_noticed_in_time_and_pings_prevent_it() -> None:
    client, server = ends()
    talk(client, server)
    for tenth in range(100):
        now_s = tenth / 10
        client.tick(now_s)
        server.tick(now_s)
        talk(client, server, now_s)
    assert client.is_up
    assert server.is_up
    server.tick(server.heard_s + 2.9)
    assert server.is_up
    server.tick(server.heard_s + 3.1)
    assert server.is_closed
    assert server.reason == "nothing was heard for 3 s."


def test_a_greeting_that_drips_is_given_up_however_often_it_drips() -> None:
    _, server = ends()
    for i, byte in enumerate(encode_frame(hello())):
        server.receive(bytes([byte]), i / 10)
        server.tick(i / 10)
    assert server.is_closed
    assert "greeting was not completed for 3 s" in server.reason


def test_a_greeting_may_be_given_more_time_than_silence() -> None:
    _, server = ends(None, {"greeting_s": float("inf")})
    server.tick(1e6)
    assert not server.is_closed


def test_half_a_frame_and_then_silence_is_given_up() -> None:
    server = greeted()
    server.receive(encode_frame(b'{"$":"page"')[:9], 1.0)
    server.tick(3.9)
    assert server.is_up
    server.tick(4.1)
    assert server.is_closed


def test_the_round_trip_is_the_time_from_a_ping_to_its_own_answer() -> None:
    server = greeted()
    server.tick(1.0)
    assert last_word(server) == Ping(1.0)
    assert server.rtt_s == 0.0  # of the ping sent when it came up
    say(server, encode_message(Pong(0.5)), now_s=1.1)
    assert server.rtt_s == 0.0
    say(server, encode_message(Pong(1.0)), now_s=1.25)
    assert server.rtt_s == 0.25


def test_who_comes_up_says_at_once_what_time_it_has() -> None:
    client, server = ends({"secret": SECRET}, {"secret": SECRET})
    for now_s in (1.0, 2.0):  # hello, then the client's proof
        for one, other in ((client, server), (server, client)):
            other.receive(said_by(one), now_s)
    assert server.is_up
    assert client.clock_offset_s is not None


def test_the_quickest_of_the_last_pings_tells_how_far_the_clocks_are_apart() -> None:
    session = greeted()
    for latency_s in (0.5, 0.1, 0.3):
        say(session, encode_message(Ping(100.0)), now_s=40.0 + latency_s)
    assert session.clock_offset_s == pytest.approx(-59.9)
    for _ in range(8):
        say(session, encode_message(Ping(100.0)), now_s=42.0)  # its clock was set back: earlier samples are dropped
    assert session.clock_offset_s == pytest.approx(-58.0)


def test_goodbye_ends_both_ends_with_its_reason() -> None:
    client, server = ends()
    talk(client, server)
    client.bye("dinner.")
    talk(client, server)
    assert server.reason == "'a_node' left: dinner."
    assert not server.was_refused


TAKES_OVER = "\x1b[2J\x1b]0;pwned\x07 ok\nlink_t is up: topside_node"


@pytest.mark.parametrize("message", [Bye(TAKES_OVER), Refused(TAKES_OVER)])
def test_a_last_word_is_shown_on_one_line_and_no_terminal_obeys_it(message: Bye | Refused) -> None:
    server = greeted()
    say(server, encode_message(message))
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
def test_what_a_refusal_quotes_no_terminal_obeys(payload: bytes) -> None:
    _, server = ends()
    say(server, payload)
    assert server.was_refused
    assert server.reason.isprintable()
    assert last_word(server).reason == server.reason


def test_a_node_whose_name_no_terminal_shows_is_refused_in_words() -> None:
    _, server = ends()
    say(server, hello(node="a\x1b[2J"))
    assert "names itself 'a\\x1b[2J', with characters that no terminal shows. Try: " in last_word(server).reason


def test_who_asks_and_never_reads_the_answers_is_left() -> None:
    server = greeted()
    for _ in range(MAX_WAITING_BYTES):
        say(server, encode_message(Ping(1.0)))
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
def test_nonsense_closes_the_session_with_a_reason_and_costs_no_memory(what: str, when: str) -> None:
    server = greeted() if when == "once up" else ends()[1]
    if when == "first" and what == "a second hello":
        say(server, hello())
    server.take_output()
    tracemalloc.start()
    pages = server.receive(HOSTILE[what], 0.0)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert pages == []
    assert server.is_closed
    assert server.reason
    assert isinstance(last_word(server), Refused)
    assert peak_bytes < 20 * len(HOSTILE[what]) + 2_000_000


def test_a_closed_session_listens_to_nobody() -> None:
    server = greeted()
    server.refuse("no.")
    assert say(server, Page("x", 1, "a_node", 0.0).serialize()) == []


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
def test_no_bytes_of_any_kind_raise_or_get_in_as_something_else_than_pages(
    is_up: bool, parts: list[bytes], cuts: list[int]
) -> None:
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
