"""Who is in a net: comings and goings, numbers, strangers. Without Zenoh and without a clock."""

from __future__ import annotations

import pytest

from snr_sim.links.fleet import MAX_KEYS, MAX_MEMBERS, Member, Roster

PLACE = "snr/fleet/rov1/auv_node/7"


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
    assert roster.hears(PLACE, 2.0) is None  # an answer that was on its way
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
    assert roster.missed == 3  # 5, 6, 7: what comes later is not taken, as it would undo what came before
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
