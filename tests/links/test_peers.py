"""Nodes of the same name on one link: pages not sent are counted and reported. No page is sent back to its origin."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim import LinkFaults, SimRunner, SocketsPair
from snr_sim.testing.function_components import FunctionLoopFactory

from .conftest import collector, simulate, ticks

HERE = "127.0.0.1"
Start = Callable[..., Any]


@pytest.fixture
def pair() -> SocketsPair:
    return SocketsPair((HERE, 0), name="t", keep_alive_s=0.05)


@pytest.mark.slow
def test_pages_between_nodes_of_one_name_are_counted_and_logged(
    start: Start, pair: SocketsPair, caplog: pytest.LogCaptureFixture
) -> None:
    one = start("robot", [pair.server("depth")], down="t")
    other = start("robot", [pair.client("cmd")])
    other.store("cmd", 0)  # may wait until the other end is connected
    for end in (one, other):
        end.until_link("t")
    one.store("depth", *range(5))
    other.store("cmd", *range(1, 5))
    words = "the other end is also named 'robot_node': its pages are taken for ours and do not cross; give one"
    for end in (one, other):
        assert end.until_link("t", sent=0, dropped=5)["reason"].startswith(words)
    assert not other.stored["depth"]
    assert not one.stored["cmd"]
    other.end()
    one.end()
    for end in (one, other):
        assert [note.startswith(f"'link_t': {words}") for note in end.node.notes].count(True) == 1
    warnings = [r for r in caplog.records if words in r.getMessage() and "is up" not in r.getMessage()]
    assert [(r.levelno, r.name) for r in warnings] == [(logging.WARNING, "snr.robot_node.link_t")] * 2


@pytest.mark.slow
def test_page_of_one_namesake_is_sent_to_the_other_and_logged(start: Start, pair: SocketsPair) -> None:
    robot = start("robot", [pair.server("chat")], down="t")
    first, second = start("pad", [pair.client("chat")]), start("pad", [pair.client("chat")])
    robot.until(lambda: len(robot.stored["link_t"][-1]["peers"]) == 2, "both")
    first.store("chat", "hello")
    assert robot.until_stored("chat") == ["hello"]
    second.until_link("t", rejected=1)  # it takes the page for its own, and counts it
    assert first.until_link("t", rejected=0)
    robot.until(lambda: "two far ends are named 'pad_node'" in robot.stored["link_t"][-1]["reason"], "reason")
    assert robot.until_link("t", sent=1)
    robot.end()
    assert any("two far ends are named 'pad_node'" in note for note in robot.node.notes)


@pytest.mark.slow
def test_reconnected_peer_counts_as_one(start: Start, raw: Callable[..., Any]) -> None:
    pair = SocketsPair((HERE, 0), name="t", keep_alive_s=0.05, timeout_s=1.0)
    robot = start("robot", [pair.server("chat")], down="t")
    raw(pair.port, node="pad_node")  # sends a hello, and nothing after it
    robot.until_link("t")
    again = start("pad", [pair.client("chat")])
    robot.until(lambda: len(robot.stored["link_t"][-1]["peers"]) == 2, "both")
    robot.until(lambda: len(robot.stored["link_t"][-1]["peers"]) == 1, "the silent one is gone")
    assert not any(state["reason"] for state in robot.stored["link_t"] if state["up"])
    again.end()
    robot.end()
    assert not any("two far ends" in note for note in robot.node.notes)


def test_forwarded_page_is_not_sent_to_its_origin() -> None:
    with_robot, with_relay, between = (SocketsPair((HERE, 1), name=name) for name in ("ar", "ab", "br"))
    stored: list[Any] = []
    roles = {
        "a": [
            FunctionLoopFactory(lambda loop: (loop.store_data("x", 1), loop.stop())),
            with_relay.client("x"),
            with_robot.client("other"),
        ],
        "b": [with_relay.server(), between.client("x")],
        "robot": [between.server(), with_robot.server("x"), collector(stored, field="origin")],
    }
    runner = simulate(roles, until_s=3.0)
    assert stored == ["a_node"]
    link = runner.nodes["robot"].components["link_ar"]
    assert (link.sent, link.transport.state(3.0)["dropped"]) == (0, 0)  # type: ignore[attr-defined]


@pytest.mark.slow
def test_page_stored_while_its_peer_leaves_is_counted(start: Start, pair: SocketsPair) -> None:
    robot = start("robot", [pair.server("depth")], down="t")
    start("pad", [pair.client()]).until_link("t")
    robot.until_link("t")
    link: Any = robot.node.components["link_t"]
    (peer,) = link.transport.peers.up
    going = threading.Thread(target=lambda: peer.session.close("it went.") or link.transport.wake())  # type: ignore[func-returns-value]
    accepts = peer.accepts

    def accept_slowly(frame: bytes) -> bool:
        going.start()
        time.sleep(0.3)  # meanwhile the link's thread finds the session closed
        return accepts(frame)

    peer.accepts = accept_slowly
    robot.store("depth", 1)
    robot.until(lambda: link.transport.peers.up != (peer,), "gone")
    robot.end()
    assert link.sent + link.dropped + link.transport.peers.unsent == 1


def run_late(count: int, begins_s: float, **options: Any) -> tuple[list[Any], SimRunner]:
    """Store pages of two keys before the peer connects; return the pages that arrived there, and the run."""
    pair = SocketsPair((HERE, 0), name="t", faults=LinkFaults(cut=((0.0, begins_s),)), **options)
    came: list[Any] = []
    numbers = iter(range(count))

    def store(loop: Any) -> None:
        for number in numbers:
            loop.store_data("say" if number % 2 else "dive", number)
            return
        loop.stop()

    roles: dict[str, list[Any]] = {
        "robot": [FunctionLoopFactory(store, "talker", 100.0), pair.server(["say", "dive"])],
        "topside": [collector(came, key=None), pair.client()],
    }
    runner = simulate(roles, until_s=begins_s + 8.0)
    return [data for data in came if isinstance(data, int)], runner


def test_pages_stored_before_the_first_connection_arrive_in_order() -> None:
    came, runner = run_late(50, 2.0)
    assert came == list(range(50))
    link: Any = runner.nodes["robot"].components["link_t"]
    assert (link.sent, link.dropped, link.transport.peers.unsent) == (50, 0, 0)
    assert not [note for note in runner.nodes["robot"].notes if "dropped" in note]


@pytest.mark.parametrize("policy", ["drop_oldest", "refuse"])
def test_pages_dropped_before_the_first_connection_are_counted_and_logged(
    policy: Any, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        came, runner = run_late(50, 2.0, queue_pages=10, policy=policy)
    assert came == (list(range(40, 50)) if policy == "drop_oldest" else list(range(10)))
    link: Any = runner.nodes["robot"].components["link_t"]
    assert (link.sent, link.dropped) == (10, 40)
    which = "oldest" if policy == "drop_oldest" else "newest"
    expected = f"the {which} 40 pages that were stored before a node connected were dropped (dive 20, say 20)"
    assert [expected in message for message in caplog.messages if "stored before" in message] == [True]
    assert [expected in note for note in runner.nodes["robot"].notes if "stored before" in note] == [True]


def test_disconnected_link_keeps_the_newest_page_of_each_key() -> None:
    pair = SocketsPair((HERE, 0), name="t", faults=LinkFaults(cut=((1.0, 6.0),)))
    came: list[Any] = []
    roles: dict[str, list[Any]] = {"robot": [ticks("x"), pair.server("x")], "topside": [collector(came), pair.client()]}
    simulate(roles, until_s=10.0)
    gap = max(later - earlier for earlier, later in itertools.pairwise(came))
    assert came[:10] == list(range(10))
    assert 45 < gap < 75


def test_queue_for_the_newest_page_alone_reports_no_loss() -> None:
    came, runner = run_late(20, 2.0, queue_pages=1)
    assert came == [19]
    assert not [note for note in runner.nodes["robot"].notes if "dropped" in note]
