"""What a net of several robots makes of pages: names, origins, who wants to hear whom; in lock step, without Zenoh."""

from __future__ import annotations

from typing import Any

import pytest

from snr_sim import Config, Faults, SimRunner, ZenohNet, tasks
from snr_sim.links.fleet import Member
from snr_sim.prelude.page import Page
from snr_sim.testing.parts import TickerFactory

HERE = "tcp/127.0.0.1:7447"


def ticks(key: str) -> TickerFactory:
    """Stores 0, 1, 2, ... ten times a second."""
    values = iter(range(1000))
    return TickerFactory(lambda loop: loop.store_data(key, next(values)), rate_hz=10)


def run(factories: dict[str, Any], until_s: float = 1.95) -> dict[str, Any]:
    runner = SimRunner(Config(factories=factories), until_s=until_s)
    runner.run()
    return dict(runner.nodes)


def test_every_node_of_a_net_hears_every_other_and_no_page_twice() -> None:
    net = ZenohNet(name="fleet", listen=HERE)
    nodes = run({"a": [ticks("x"), net.link("x")], "b": [net.link("x")], "c": [net.link("x")]})
    assert nodes["b"].get_data("x") == nodes["c"].get_data("x") == 19
    for role in "bc":  # with every x they could have passed on to each other
        assert nodes[role].get_data("link_fleet")["received"] <= 20
        assert nodes[role].get_data("link_fleet")["sent"] == 0
    state = nodes["a"].get_data("link_fleet")
    assert (state["up"], sorted(state["peers"]), state["received"]) == (True, ["b_node", "c_node"], 0)


def test_pages_of_other_robots_are_kept_apart_if_wanted() -> None:
    net = ZenohNet(name="fleet", listen=HERE)
    nodes = run(
        {
            "rov1": [ticks("depth"), net.link("depth", robot="rov1")],
            "rov2": [ticks("depth"), net.link("depth", robot="rov2")],
            "camera": [net.link(robot="rov1", robots="rov1", apart=True)],
            "shore": [net.link(apart=True)],
        }
    )
    assert nodes["shore"].get_data("rov1/depth") == nodes["shore"].get_data("rov2/depth") == 19
    assert nodes["shore"].get_page("rov2/depth").origin == "rov2/rov2_node"
    assert nodes["shore"].get_data("depth") is None
    assert nodes["camera"].get_page("depth").origin == "rov1_node"  # of its own robot, so as it is
    assert nodes["camera"].get_data("rov2/depth") is None  # whom it does not want to hear
    assert nodes["rov1"].get_page("depth").origin in ("rov1_node", "rov2/rov2_node")


def test_only_accepted_keys_come_in_and_the_rest_is_counted() -> None:
    net = ZenohNet(name="fleet", listen=HERE)
    nodes = run({"a": [ticks("x"), net.link("x")], "b": [net.link(accept=["y"])]})
    assert nodes["b"].get_data("x") is None
    assert nodes["b"].get_data("link_fleet")["unwanted"] >= 10


def test_a_page_that_comes_round_by_another_way_is_not_taken_back() -> None:
    me, other = Member("rov1", "auv_node"), Member("shore_node", "shore_node")
    page = Page("depth", 1.0, "auv_node", 0.0)
    there = me.brings(page, other, apart=False)
    assert there.origin == me.name == "rov1/auv_node"
    assert other.brings(there, me, apart=False).origin == me.name  # by which its Fleet knows it
    assert me.brings(page, Member("rov1", "camera_node"), apart=True) is page


def test_faults_of_a_net_are_those_of_its_links_and_the_same_in_every_run() -> None:
    def outcome() -> tuple[Any, ...]:
        net = ZenohNet(name="fleet", listen=HERE, faults=Faults(latency_s=0.05, loss=0.3))
        nodes = run({"a": [ticks("x"), net.link("x")], "b": [net.link()]}, until_s=5.0)
        state = nodes["b"].get_data("link_fleet")
        return state["received"], nodes["a"].get_data("link_fleet")["dropped"], round(state["rtt_s"], 9)

    received, dropped, rtt_s = outcome()
    assert outcome() == (received, dropped, rtt_s)
    assert 15 < received < 45
    assert dropped > 5
    assert rtt_s == pytest.approx(0.1)


def test_a_cut_takes_the_net_down_and_its_end_brings_it_back() -> None:
    states: list[bool] = []
    net = ZenohNet(name="fleet", listen=HERE, faults=Faults(cut=((1.0, 3.0),)), keep_alive_s=0.1, timeout_s=0.5)
    watch = TickerFactory(lambda loop: states.append(loop.parent.get_data("link_fleet")["up"]), rate_hz=2)
    watch_later = [net.link("x"), watch]
    run({"a": watch_later, "b": [net.link()]}, until_s=4.9)
    assert states[1:3] == [True, True]  # 0.5 and 1.0 s
    assert states[4:6] == [False, False]  # 2.0 and 2.5 s
    assert states[7:] == [True, True, True]  # from 3.5 s


def test_a_page_sent_before_its_node_left_arrives_before_the_others_notice() -> None:
    def says_goodbye(loop: Any) -> None:
        loop.store_data("x", "goodbye")
        loop.schedule(tasks.finish("enough"))

    came: list[tuple[Any, bool]] = []
    watch = TickerFactory(lambda loop: came.append((loop.get_data("x"), loop.get_data("link_fleet")["up"])), rate_hz=10)
    net = ZenohNet(name="fleet", listen=HERE, faults=Faults(latency_s=0.15))
    run({"a": [TickerFactory(says_goodbye, rate_hz=1), net.link("x")], "b": [net.link(), watch]}, until_s=1.5)
    assert came[0][0] is None
    assert came[-1] == ("goodbye", False)
