"""A node's end of a console connection, without a port and without a clock: bounds, order, silence."""

from typing import Any

import pytest

from snr_sim.console.command_receiver import LINES_AT_ONCE, LINES_PER_S, MAX_OUTPUT_BYTES, ConsoleProtocol
from snr_sim.console.wire import (
    PURPOSE,
    CommandMessage,
    CompleteMessage,
    CompletionsMessage,
    Reply,
    decode_response,
    encode_request,
)
from snr_sim.links.frames import encode_frame
from snr_sim.links.session import Session as WireSession
from snr_sim.links.session import SessionConfig
from snr_sim.links.token_bucket import TokenBucket

from .conftest import Talk


def token_bucket() -> TokenBucket:
    return TokenBucket(LINES_PER_S, LINES_AT_ONCE)


class Ends:
    """Both ends of a connection."""

    def __init__(self, talk: Talk) -> None:
        self.near = ConsoleProtocol(
            SessionConfig("urov_node", True, purpose=PURPOSE), talk.session, 0.0, token_bucket()
        )
        self.far = WireSession(SessionConfig("console", False, purpose=PURPOSE), 0.0, decode_response)
        self.receive(0.0)
        self.send(b"", 0.0)
        assert self.near.wire.is_up

    def send(self, frames: bytes, now_s: float) -> None:
        self.near.receive(b"".join(self.far.take_output()) + frames, now_s)
        self.near.work(now_s)

    def receive(self, now_s: float) -> list[Any]:
        data, self.near.output = bytes(self.near.output), bytearray()
        return self.far.receive(data, now_s)


@pytest.fixture
def ends(talk: Talk) -> Ends:
    return Ends(talk)


def test_replies_keep_order_and_numbers_of_lines(ends: Ends) -> None:
    ends.send(
        encode_request(CommandMessage(7, "help"))
        + encode_request(CompleteMessage(8, "sto"))
        + encode_request(CommandMessage(9, "stroe")),
        0.1,
    )
    help_, words, refused = ends.receive(0.1)
    assert isinstance(help_, Reply)
    assert (help_.number, help_.is_error) == (7, False)
    assert words == CompletionsMessage(8, ["store"])
    assert (refused.number, refused.is_error) == (9, True)


def test_flood_of_lines_is_answered_at_a_bounded_rate(ends: Ends) -> None:
    ends.send(encode_request(CommandMessage(1, "unwatch")) * 1000, 0.1)
    assert len(ends.receive(0.1)) == LINES_AT_ONCE
    assert not ends.near.wants_bytes
    for i in range(1, 100):
        ends.near.work(0.1 + i * 0.001)
    assert len([one for one in ends.receive(0.2) if isinstance(one, Reply)]) == pytest.approx(50, abs=2)


def test_non_reading_client_gets_no_more_answers_and_is_closed(talk: Talk, ends: Ends) -> None:
    talk.node.store_data("long", "x" * 2000)
    talk.settle()
    ends.send(encode_request(CommandMessage(1, "dump long")) * 100, 0.1)
    ends.near.work(1.0)
    assert MAX_OUTPUT_BYTES < len(ends.near.output) < 2 * MAX_OUTPUT_BYTES
    assert not ends.near.wants_bytes
    ends.near.work(2.0)
    assert not ends.near.is_over
    ends.near.work(3.5)
    assert ends.near.is_over


def test_silent_client_is_closed_after_the_timeout(talk: Talk, ends: Ends) -> None:
    silent = ConsoleProtocol(SessionConfig("urov_node", True, purpose=PURPOSE), talk.session, 0.0, token_bucket())
    for protocol in (ends.near, silent):
        protocol.work(2.9)
        assert not protocol.is_over
        protocol.work(3.2)
        assert protocol.is_over


def test_link_at_a_console_port_is_refused_with_both_purposes(talk: Talk) -> None:
    near = ConsoleProtocol(SessionConfig("urov_node", True, purpose=PURPOSE), talk.session, 0.0, token_bucket())
    link = WireSession(SessionConfig("topside_node", False), 0.0)
    near.receive(b"".join(link.take_output()), 0.0)
    assert "console" in near.wire.reason
    assert "pages" in near.wire.reason


def test_line_beyond_the_maximum_closes_the_connection(ends: Ends) -> None:
    ends.send(encode_frame(b'{"$":"command","number":1,"line":"%s"}' % (b"x" * 16_385)), 0.1)
    assert ends.near.is_over


def test_reload_outcome_is_sent_before_later_replies(talk: Talk, ends: Ends) -> None:
    ends.send(encode_request(CommandMessage(1, "reload part")) + encode_request(CommandMessage(2, "help")), 0.1)
    assert ends.receive(0.1) == []
    talk.settle()
    ends.send(b"", 0.2)
    outcome, later = ends.receive(0.2)
    assert (outcome.number, later.number) == (1, 2)
    assert "part" in outcome.text


def test_reload_without_outcome_returns_error_after_the_timeout(ends: Ends) -> None:
    ends.send(encode_request(CommandMessage(1, "reload part")), 0.1)
    for now_s in (0.2, 3.0, 5.0):
        ends.send(b"", now_s)
        assert ends.receive(now_s) == []
    ends.send(b"", 5.3)
    (answer,) = ends.receive(5.3)
    assert answer.is_error
    assert "has no result after" in answer.text
