"""Pages in a net of several robots, in lock step and without Zenoh; and its members, when they join and leave."""

from __future__ import annotations

from typing import Any

import pytest

from snr_sim import LinkFaults, SocketsPair, ZenohNet, tasks
from snr_sim.links.fleet import MAX_KEYS, MAX_MEMBERS, Member, PeerTable
from snr_sim.prelude.task import Page
from snr_sim.testing.function_components import FunctionLoopFactory

from .conftest import simulate, ticks

HERE = "tcp/127.0.0.1:7447"
ADDRESS = "snr/fleet/rov1/auv_node/7"


def run(roles: dict[str, Any], until_s: float = 1.95) -> dict[str, Any]:
    return dict(simulate(roles, until_s).nodes)


def test_every_node_of_a_net_receives_each_page_once() -> None:
    net = ZenohNet(name="fleet", listen=HERE)
    nodes = run({"a": [ticks("x"), net.link("x")], "b": [net.link("x")], "c": [net.link("x")]})
    assert nodes["b"].get_data("x") == nodes["c"].get_data("x") == 19
    for role in "bc":  # with every x that they could have forwarded to each other
        assert nodes[role].get_data("link_fleet")["received"] <= 20
        assert nodes[role].get_data("link_fleet")["sent"] == 0
    state = nodes["a"].get_data("link_fleet")
    assert (state["up"], sorted(state["peers"]), state["received"]) == (True, ["b_node", "c_node"], 0)


def test_namespaced_link_stores_pages_by_robot() -> None:
    net = ZenohNet(name="fleet", listen=HERE)
    nodes = run(
        {
            "rov1": [ticks("depth"), net.link("depth", robot="rov1")],
            "rov2": [ticks("depth"), net.link("depth", robot="rov2")],
            "camera": [net.link(robot="rov1", robots="rov1", namespaced=True)],
            "shore": [net.link(namespaced=True)],
        }
    )
    assert nodes["shore"].get_data("rov1/depth") == nodes["shore"].get_data("rov2/depth") == 19
    assert nodes["shore"].get_page("rov2/depth").origin == "rov2/rov2_node"
    assert nodes["shore"].get_data("depth") is None
    assert nodes["camera"].get_page("depth").origin == "rov1_node"  # of its own robot, so unchanged
    assert nodes["camera"].get_data("rov2/depth") is None  # from a robot that it does not accept
    assert nodes["rov1"].get_page("depth").origin in ("rov1_node", "rov2/rov2_node")


def test_keys_not_in_accept_are_rejected_and_counted() -> None:
    net = ZenohNet(name="fleet", listen=HERE)
    nodes = run({"a": [ticks("x"), net.link("x")], "b": [net.link(accept=["y"])]})
    assert nodes["b"].get_data("x") is None
    assert nodes["b"].get_data("link_fleet")["rejected"] >= 10


def test_own_page_over_another_path_keeps_the_name_of_its_member() -> None:
    me, other = Member("rov1", "auv_node"), Member("shore_node", "shore_node")
    page = Page("depth", 1.0, "auv_node", 0.0)
    there = me.with_namespace(page, other, namespaced=False)
    assert there.origin == me.name == "rov1/auv_node"
    assert other.with_namespace(there, me, namespaced=False).origin == me.name  # the name that its Fleet knows
    assert me.with_namespace(page, Member("rov1", "camera_node"), namespaced=True) is page


@pytest.mark.parametrize("robot", ["rov1", "rov2"])
def test_own_page_that_another_node_forwards_is_rejected(robot: str) -> None:
    net, pair = ZenohNet(name="fleet", listen=HERE), SocketsPair(("127.0.0.1", 0), name="t")
    nodes = run(
        {
            "auv": [ticks("depth"), pair.server("depth"), net.link(robot="rov1")],
            "camera": [pair.client(), net.link("depth", robot=robot)],
        }
    )
    assert nodes["camera"].get_data("depth") >= 18
    state = nodes["auv"].get_data("link_fleet")
    assert (state["received"], state["rejected"] >= 10) == (0, True)


def test_faults_of_a_net_are_the_same_in_every_run() -> None:
    def outcome() -> tuple[Any, ...]:
        net = ZenohNet(name="fleet", listen=HERE, faults=LinkFaults(latency_s=0.05, loss=0.3))
        nodes = run({"a": [ticks("x"), net.link("x")], "b": [net.link()]}, until_s=5.0)
        state = nodes["b"].get_data("link_fleet")
        return state["received"], nodes["a"].get_data("link_fleet")["dropped"], round(state["rtt_s"], 9)

    received, dropped, rtt_s = outcome()
    assert outcome() == (received, dropped, rtt_s)
    assert 15 < received < 45
    assert dropped > 5
    assert rtt_s == pytest.approx(0.1)


def test_cut_takes_the_net_down_until_its_end() -> None:
    states: list[bool] = []
    net = ZenohNet(name="fleet", listen=HERE, faults=LinkFaults(cut=((1.0, 3.0),)), keep_alive_s=0.1, timeout_s=0.5)
    watch = FunctionLoopFactory(lambda loop: states.append(loop.parent.get_data("link_fleet")["up"]), rate_hz=2)
    watch_later = [net.link("x"), watch]
    run({"a": watch_later, "b": [net.link()]}, until_s=4.9)
    assert states[1:3] == [True, True]  # 0.5 and 1.0 s
    assert states[4:6] == [False, False]  # 2.0 and 2.5 s
    assert states[7:] == [True, True, True]  # from 3.5 s


def test_last_page_arrives_before_the_link_is_down() -> None:
    def store_and_end(loop: Any) -> None:
        loop.store_data("x", "goodbye")
        loop.schedule(tasks.finish("enough"))

    came: list[tuple[Any, bool]] = []
    watch = FunctionLoopFactory(
        lambda loop: came.append((loop.get_data("x"), loop.get_data("link_fleet")["up"])), rate_hz=10
    )
    net = ZenohNet(name="fleet", listen=HERE, faults=LinkFaults(latency_s=0.15))
    run({"a": [FunctionLoopFactory(store_and_end, rate_hz=1), net.link("x")], "b": [net.link(), watch]}, until_s=1.5)
    assert came[0][0] is None
    assert came[-1] == ("goodbye", False)


# Members of a net, without a clock


@pytest.fixture
def peer_table() -> PeerTable:
    return PeerTable("snr/fleet")


def test_address_contains_its_member(peer_table: PeerTable) -> None:
    member = Member("rov 1/*", "auv?node")
    peer_table.mark_present(peer_table.address_of(member, "7"), 0.0, joins=True)
    assert [peer.member for peer in peer_table.present()] == [member]


def test_returning_member_is_new_and_its_last_page_is_not(peer_table: PeerTable) -> None:
    peer_table.mark_present(ADDRESS, 0.0, joins=True)
    assert (peer_table.consume_new_peer_flag(), peer_table.consume_new_peer_flag()) == (True, False)
    peer, is_new = peer_table.record_page(ADDRESS, "x", 5, 1.0)
    assert (peer, is_new) == (peer_table.present()[0], True)
    peer_table.record_leave(ADDRESS)
    assert peer_table.present() == []
    assert peer_table.leave_message == "'rov1/auv_node' left."
    assert peer_table.mark_present(ADDRESS, 2.0) is None  # a reply sent before it left
    assert peer_table.present() == []
    peer_table.mark_present(ADDRESS, 3.0, joins=True)
    assert peer_table.present() == [peer]
    assert peer_table.consume_new_peer_flag()
    assert peer_table.record_page(ADDRESS, "x", 5, 4.0) == (peer, False)
    assert peer_table.record_page(ADDRESS, "x", 6, 5.0) == (peer, True)
    assert peer_table.missed == 0


def test_answering_member_is_present(peer_table: PeerTable) -> None:
    assert peer_table.mark_present(ADDRESS, 0.0) is not None
    assert len(peer_table.present()) == 1
    assert peer_table.consume_new_peer_flag()


def test_skipped_sequence_numbers_are_counted_as_missed(peer_table: PeerTable) -> None:
    for number in (3, 4, 8, 8, 7, 9):
        peer_table.record_page(ADDRESS, "x", number, 0.0)
    assert peer_table.missed == 3  # 5, 6, 7: late pages are ignored, since they would overwrite newer ones
    assert [peer_table.record_page(ADDRESS, "y", 0, 0.0)[1] for _ in range(3)] == [True] * 3


INVALID = ("", "snr/fleet", "snr/fleet/a/b", "snr/fleet/a/b/1/more", "snr/other/a/b/1")
HOSTILE = ("snr/fleet/*/b/1", "snr/fleet/**", "snr/fleet/rov1/a%0Ab/7", "snr/fleet/r%1B[2J/auv_node/7")


@pytest.mark.parametrize("address", [*INVALID, *HOSTILE, ADDRESS])
def test_invalid_unprintable_or_own_address_is_ignored(peer_table: PeerTable, address: str) -> None:
    peer_table.own_address = ADDRESS
    peer_table.mark_present(address, 0.0, joins=True)
    assert peer_table.record_page(address, "x", 1, 0.0) == (None, False)
    assert peer_table.present() == []


def test_flood_of_addresses_uses_bounded_memory_and_keeps_present_members(peer_table: PeerTable) -> None:
    peer_table.mark_present(ADDRESS, 0.0, joins=True)
    for number in range(2 * MAX_MEMBERS):
        peer_table.record_page(f"snr/fleet/a/b/{number}", "x", 1, 0.0)
    assert [peer.member.robot for peer in peer_table.present()] == ["rov1"]
    assert len(peer_table._peers) == MAX_MEMBERS
    for number in range(2 * MAX_KEYS):
        assert peer_table.record_page(ADDRESS, f"key{number}", 1, 0.0)[1]
    assert len(peer_table.present()[0].numbers) == MAX_KEYS
