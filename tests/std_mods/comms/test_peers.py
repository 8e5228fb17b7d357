"""Nodes of one name on one link: what does not cross is counted and told. And no page goes back where it came from."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim import Config, SimRunner, SocketsPair, TaskType
from snr_sim.testing.parts import PartFactory, TickerFactory

HERE = "127.0.0.1"
Start = Callable[..., Any]


@pytest.fixture
def pair() -> SocketsPair:
    return SocketsPair((HERE, 0), name="t", keep_alive_s=0.05)


@pytest.mark.slow
def test_pages_between_two_nodes_of_one_name_are_counted_and_told_at_both_ends(
    start: Start, pair: SocketsPair, caplog: pytest.LogCaptureFixture
) -> None:
    one = start("robot", [pair.server("depth")])
    one.until_link("t", up=False)
    other = start("robot", [pair.client("cmd")])
    other.store("cmd", 0)  # waits, perhaps, until the other end is there
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
    said = [r for r in caplog.records if words in r.getMessage() and "is up" not in r.getMessage()]
    assert [(r.levelno, r.name) for r in said] == [(logging.WARNING, "snr.robot_node.link_t")] * 2


@pytest.mark.slow
def test_a_page_of_one_of_two_far_ends_of_one_name_is_sent_to_the_other_and_that_is_told(
    start: Start, pair: SocketsPair
) -> None:
    robot = start("robot", [pair.server("chat")])
    robot.until_link("t", up=False)
    first, second = start("pad", [pair.client("chat")]), start("pad", [pair.client("chat")])
    robot.until(lambda: len(robot.stored["link_t"][-1]["peers"]) == 2, "both")
    first.store("chat", "hello")
    assert robot.until_stored("chat") == ["hello"]
    second.until_link("t", unwanted=1)  # it takes it for its own, and counts it
    assert first.until_link("t", unwanted=0)
    robot.until(lambda: "two far ends are named 'pad_node'" in robot.stored["link_t"][-1]["reason"], "reason")
    assert robot.until_link("t", sent=1)
    robot.end()
    assert any("two far ends are named 'pad_node'" in note for note in robot.node.notes)


@pytest.mark.slow
def test_who_lost_a_connection_and_called_again_is_not_two(start: Start, raw: Callable[..., Any]) -> None:
    pair = SocketsPair((HERE, 0), name="t", keep_alive_s=0.05, timeout_s=1.0)
    robot = start("robot", [pair.server("chat")])
    robot.until_link("t", up=False)
    raw(pair.port, node="pad_node")  # says hello, and nothing any more
    robot.until_link("t")
    again = start("pad", [pair.client("chat")])
    robot.until(lambda: len(robot.stored["link_t"][-1]["peers"]) == 2, "both")
    robot.until(lambda: len(robot.stored["link_t"][-1]["peers"]) == 1, "the silent one is gone")
    assert not any(state["reason"] for state in robot.stored["link_t"] if state["up"])
    again.end()
    robot.end()
    assert not any("two far ends" in note for note in robot.node.notes)


def test_a_page_that_another_node_passed_on_is_not_sent_to_the_node_that_made_it() -> None:
    with_robot, with_relay, between = (SocketsPair((HERE, 1), name=name) for name in ("ar", "ab", "br"))
    stored: list[Any] = []
    keeps = PartFactory({(TaskType.store_page, "x"): lambda task, task_id: stored.append(task.val_list[0].origin)})
    roles = {
        "a": [
            TickerFactory(lambda loop: (loop.store_data("x", 1), loop.stop())),
            with_relay.client("x"),
            with_robot.client("other"),
        ],
        "b": [with_relay.server(), between.client("x")],
        "robot": [between.server(), with_robot.server("x"), keeps],
    }
    runner = SimRunner(Config(factories=roles), until_s=3.0)
    runner.run()
    assert stored == ["a_node"]
    link = runner.nodes["robot"].components["link_ar"]
    assert (link.sent, link._state(3.0)["dropped"]) == (0, 0)  # type: ignore[attr-defined]


@pytest.mark.slow
def test_page_that_is_stored_while_its_far_end_goes_is_counted(start: Start, pair: SocketsPair) -> None:
    robot = start("robot", [pair.server("depth")])
    robot.until_link("t", up=False)
    start("pad", [pair.client()]).until_link("t")
    robot.until_link("t")
    link: Any = robot.node.components["link_t"]
    (peer,) = link.peers
    going = threading.Thread(target=lambda: peer.session.lost("it went.") or link.wake())  # type: ignore[func-returns-value]
    takes = peer.takes

    def take_slowly(frame: bytes) -> bool:
        going.start()
        time.sleep(0.3)  # in which the link's thread finds the session over
        return takes(frame)

    peer.takes = take_slowly
    robot.store("depth", 1)
    robot.until(lambda: not link.peers or link.peers != (peer,), "gone")
    robot.end()
    assert link.sent + link.dropped + len(link._unsent) == 1
