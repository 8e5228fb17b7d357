"""Pages in a net of several robots, in lock step and without Zenoh; and its members, when they join and leave."""

from __future__ import annotations

from typing import Any

import pytest

from snr_sim import Faults, ZenohNet, tasks
from snr_sim.links.fleet import MAX_KEYS, MAX_MEMBERS, Member, Roster
from snr_sim.prelude.page import Page
from snr_sim.testing.parts import TickerFactory

from .conftest import simulate, ticks

HERE = "tcp/127.0.0.1:7447"
PLACE = "snr/fleet/rov1/auv_node/7"


def run(roles: dict[str, Any], until_s: float = 1.95) -> dict[str, Any]:
    return dict(simulate(roles, until_s).nodes)


def test_every_node_of_a_net_hears_every_other_and_no_page_twice() -> None:
    net = ZenohNet(name="fleet", listen=HERE)
    nodes = run({"a": [ticks("x"), net.link("x")], "b": [net.link("x")], "c": [net.link("x")]})
    assert nodes["b"].get_data("x") == nodes["c"].get_data("x") == 19
    for role in "bc":  # with every x that they could have forwarded to each other
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
    assert nodes["camera"].get_page("depth").origin == "rov1_node"  # of its own robot, so unchanged
    assert nodes["camera"].get_data("rov2/depth") is None  # from a robot that it does not accept
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
    assert other.brings(there, me, apart=False).origin == me.name  # the name under which its Fleet knows it
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


# Members of a net, without a clock


@pytest.fixture
def roster() -> Roster:
    return Roster("snr/fleet")


def test_a_place_says_who_stands_there(roster: Roster) -> None:
    member = Member("rov 1/*", "auv?node")
    roster.shows(roster.place_of(member, "7"), 0.0)
    assert [far.member for far in roster.here()] == [member]


@pytest.mark.parametrize("place", ["snr/fleet/rov1/a%0Ab/7", "snr/fleet/r%1B[2J/auv_node/7"])
def test_whose_name_no_terminal_shows_is_not_listened_to(roster: Roster, place: str) -> None:
    roster.shows(place, 0.0)
    assert roster.takes(place, "x", 1, 0.0) == (None, False)
    assert roster.here() == []


def test_who_left_and_is_back_is_a_newcomer_whose_last_page_is_none(roster: Roster) -> None:
    roster.shows(PLACE, 0.0)
    assert (roster.take_newcomer(), roster.take_newcomer()) == (True, False)
    far, is_new = roster.takes(PLACE, "x", 5, 1.0)
    assert (far, is_new) == (roster.here()[0], True)
    roster.leaves(PLACE)
    assert roster.here() == []
    assert roster.news == "'rov1/auv_node' left."
    assert roster.hears(PLACE, 2.0) is None  # a reply sent before it left
    assert roster.here() == []
    roster.shows(PLACE, 3.0)
    assert roster.here() == [far]
    assert roster.take_newcomer()
    assert roster.takes(PLACE, "x", 5, 4.0) == (far, False)
    assert roster.takes(PLACE, "x", 6, 5.0) == (far, True)
    assert roster.missed == 0


def test_who_only_answers_is_there_too(roster: Roster) -> None:
    assert roster.hears(PLACE, 0.0) is not None
    assert len(roster.here()) == 1
    assert roster.take_newcomer()


def test_numbers_that_are_passed_over_are_pages_missed(roster: Roster) -> None:
    for number in (3, 4, 8, 8, 7, 9):
        roster.takes(PLACE, "x", number, 0.0)
    assert roster.missed == 3  # 5, 6, 7: late pages are ignored, since they would overwrite newer ones
    assert [roster.takes(PLACE, "y", 0, 0.0)[1] for _ in range(3)] == [True] * 3


@pytest.mark.parametrize(
    "place",
    ["", "snr/fleet", "snr/fleet/a/b", "snr/fleet/a/b/1/more", "snr/other/a/b/1", "snr/fleet/*/b/1", "snr/fleet/**"],
)
def test_where_nobody_can_stand_nobody_stands(roster: Roster, place: str) -> None:
    roster.shows(place, 0.0)
    assert roster.here() == []
    assert roster.takes(place, "x", 1, 0.0) == (None, False)


def test_a_node_does_not_meet_itself(roster: Roster) -> None:
    roster.own_place = PLACE
    roster.shows(PLACE, 0.0)
    assert roster.here() == []


def test_a_flood_of_places_costs_bounded_memory_and_drives_nobody_out(roster: Roster) -> None:
    roster.shows(PLACE, 0.0)
    for number in range(2 * MAX_MEMBERS):
        roster.takes(f"snr/fleet/a/b/{number}", "x", 1, 0.0)
    assert [far.member.robot for far in roster.here()] == ["rov1"]
    assert len(roster._fars) == MAX_MEMBERS
    for number in range(2 * MAX_KEYS):
        assert roster.takes(PLACE, f"key{number}", 1, 0.0)[1]
    assert len(roster.here()[0].numbers) == MAX_KEYS
