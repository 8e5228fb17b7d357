"""A node's end of a console connection, without a port and without a clock: bounds, order, silence."""

from typing import Any

import pytest

from snr_sim.console.conversation import LINES_AT_ONCE, LINES_PER_S, OUTPUT_MAX_BYTES, Conversation
from snr_sim.console.wire import PURPOSE, Command, Complete, Reply, Words, asked, decode_answered
from snr_sim.links.allowance import Allowance
from snr_sim.links.frames import encode_frame
from snr_sim.links.session import Session as WireSession
from snr_sim.links.session import Terms

from .conftest import Talk


def allowance() -> Allowance:
    return Allowance(LINES_PER_S, LINES_AT_ONCE)


class Ends:
    """Both ends of a connection."""

    def __init__(self, talk: Talk) -> None:
        self.near = Conversation(Terms("urov_node", True, purpose=PURPOSE), talk.session, 0.0, allowance())
        self.far = WireSession(Terms("console", False, purpose=PURPOSE), 0.0, decode_answered)
        self.hear(0.0)
        self.say(b"", 0.0)
        assert self.near.wire.is_up

    def say(self, frames: bytes, now_s: float) -> None:
        self.near.receive(b"".join(self.far.take_output()) + frames, now_s)
        self.near.work(now_s)

    def hear(self, now_s: float) -> list[Any]:
        data, self.near.output = bytes(self.near.output), bytearray()
        return self.far.receive(data, now_s)


@pytest.fixture
def ends(talk: Talk) -> Ends:
    return Ends(talk)


def test_lines_are_answered_in_order_with_their_numbers(ends: Ends) -> None:
    ends.say(asked(Command(7, "help")) + asked(Complete(8, "sto")) + asked(Command(9, "stroe")), 0.1)
    help_, words, refused = ends.hear(0.1)
    assert isinstance(help_, Reply)
    assert (help_.number, help_.is_error) == (7, False)
    assert words == Words(8, ["store"])
    assert (refused.number, refused.is_error) == (9, True)


def test_a_flood_of_lines_is_answered_at_a_bounded_rate(ends: Ends) -> None:
    ends.say(asked(Command(1, "unwatch")) * 1000, 0.1)
    assert len(ends.hear(0.1)) == LINES_AT_ONCE
    assert not ends.near.wants_bytes
    for i in range(1, 100):
        ends.near.work(0.1 + i * 0.001)
    assert len([one for one in ends.hear(0.2) if isinstance(one, Reply)]) == pytest.approx(50, abs=2)


def test_whoever_does_not_read_gets_no_more_answers_and_is_left(talk: Talk, ends: Ends) -> None:
    talk.node.store_data("long", "x" * 2000)
    talk.settle()
    ends.say(asked(Command(1, "dump long")) * 100, 0.1)
    ends.near.work(1.0)
    assert OUTPUT_MAX_BYTES < len(ends.near.output) < 2 * OUTPUT_MAX_BYTES
    assert not ends.near.wants_bytes
    ends.near.work(2.0)
    assert not ends.near.is_over
    ends.near.work(3.5)
    assert ends.near.is_over


def test_whoever_says_nothing_is_left(talk: Talk, ends: Ends) -> None:
    stranger = Conversation(Terms("urov_node", True, purpose=PURPOSE), talk.session, 0.0, allowance())
    for conversation in (ends.near, stranger):
        conversation.work(2.9)
        assert not conversation.is_over
        conversation.work(3.2)
        assert conversation.is_over


def test_a_link_that_calls_a_console_is_told(talk: Talk) -> None:
    near = Conversation(Terms("urov_node", True, purpose=PURPOSE), talk.session, 0.0, allowance())
    link = WireSession(Terms("topside_node", False), 0.0)
    near.receive(b"".join(link.take_output()), 0.0)
    assert "console" in near.wire.reason
    assert "pages" in near.wire.reason


def test_a_line_longer_than_lines_are_ends_the_conversation(ends: Ends) -> None:
    ends.say(encode_frame(b'{"$":"command","number":1,"line":"%s"}' % (b"x" * 16_385)), 0.1)
    assert ends.near.is_over


def test_a_reload_is_answered_once_its_outcome_is_known_and_before_what_was_asked_later(talk: Talk, ends: Ends) -> None:
    ends.say(asked(Command(1, "reload part")) + asked(Command(2, "help")), 0.1)
    assert ends.hear(0.1) == []
    talk.settle()
    ends.say(b"", 0.2)
    outcome, later = ends.hear(0.2)
    assert (outcome.number, later.number) == (1, 2)
    assert "part" in outcome.text


def test_a_reload_of_which_nothing_comes_is_said_after_a_while(ends: Ends) -> None:
    ends.say(asked(Command(1, "reload part")), 0.1)
    for now_s in (0.2, 3.0, 5.0):
        ends.say(b"", now_s)
        assert ends.hear(now_s) == []
    ends.say(b"", 5.3)
    (answer,) = ends.hear(5.3)
    assert answer.is_error
    assert "nothing has come of it" in answer.text
