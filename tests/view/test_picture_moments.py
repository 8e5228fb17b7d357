"""Events of a run, as text."""

from __future__ import annotations

import msgspec
import numpy as np

from snr_sim.prelude.page import Page
from snr_sim.recording.columns import Batch
from snr_sim.recording.records import PageRecord, Record
from snr_sim.view.picture_flight import Flight
from snr_sim.view.picture_moments import MOMENTS_MAX, moments_of_run


def flight(values: list[dict[str, float]], current_mps: list[float] | None = None, to_m: float = 0.0) -> Flight:
    """Along x through the origin's x, half a second each."""
    count = len(values)
    poses = np.zeros((count, 7))
    poses[:, 0], poses[:, 2], poses[:, 6] = np.linspace(-to_m, to_m, count), -1.5, 1.0
    speeds = current_mps or [0.0] * count
    arrows = [{"current": [0.0, 0.0, 0.0, 40.0 * speed, 0.0, 0.0]} if speed else {} for speed in speeds]
    return Flight(0.5 * np.arange(count), {"vehicle": poses}, arrows, values, None)


def page(seq: int, key: str, data: dict[str, object], node: str = "urov", origin: str = "urov") -> PageRecord:
    raw = msgspec.Raw(b"[" + Page(key, data, origin, seq * 0.5).serialize() + b"]")
    return PageRecord(seq, seq * 0.5, node, "store_page", key, raw, 1, 0, [])


def told(of: Flight, records: list[Record] | None = None, gate: dict[str, object] | None = None) -> list[str]:
    batch = Batch()
    batch.extend(records or [])
    return [f"{one.time_s:g} {one.words}" for one in moments_of_run(of, {"gate_1": gate} if gate else {}, batch)]


def test_what_breaks_comes_in_or_is_let_go_is_told_when_it_does() -> None:
    values = [{"broken_T3": float(i >= 2), "water_l": max(0.0, i - 2.0), "load_kg": 0.5 * (i < 4)} for i in range(6)]
    assert told(flight(values)) == ["1 T3 fails", "1.5 water comes in", "2 payload of 0.5 kg let go"]


def test_a_current_is_told_when_it_changes_and_not_when_it_was_there() -> None:
    assert told(flight([{}] * 4, [0.1, 0.1, 0.3, 0.301])) == ["1 current: 0.30 m/s"]
    assert told(flight([{}] * 4, [0.2, 0.2, 0.2, 0.2])) == []


def test_a_gate_is_told_if_the_way_leads_through_it_and_not_past_it() -> None:
    corners = [[0.3, 1.0, -1.0], [0.3, 1.0, -2.0], [0.3, -1.0, -2.0], [0.3, -1.0, -1.0], [0.3, 1.0, -1.0]]
    gate: dict[str, object] = {"label": "gate 1", "points_m": corners}
    assert told(flight([{}] * 5, to_m=1.0), gate=gate) == ["1.5 through gate 1"]
    beside: dict[str, object] = {**gate, "points_m": [[x, y + 3.0, z] for x, y, z in corners]}
    above: dict[str, object] = {**gate, "points_m": [[x, y, z + 0.8] for x, y, z in corners]}
    assert told(flight([{}] * 5, to_m=1.0), gate=beside) == []
    assert told(flight([{}] * 5, to_m=1.0), gate=above) == []


def test_a_link_is_told_when_it_is_lost_and_comes_back_once_for_both_ends() -> None:
    records: list[Record] = []
    for seq, is_up in enumerate([False, True, True, False, False, True]):
        for node in ("urov", "topside"):
            records.append(page(seq, "link_tether", {"up": is_up, "sent": seq}, node, node))
    assert told(flight([{}] * 6), records) == ["1.5 link is lost", "2.5 link is back"]


def test_what_rules_is_told_by_who_makes_the_page_and_not_by_who_is_sent_it() -> None:
    records: list[Record] = [
        page(seq, "vehicle", {"rules": rules}) for seq, rules in enumerate(["idle", "pilot", "pilot"])
    ]
    copies: list[Record] = [
        page(seq + 9, "vehicle", {"rules": rules}, "topside") for seq, rules in enumerate(["idle", "pilot"])
    ]
    assert told(flight([{}] * 3), [*records, *copies]) == ["0.5 'pilot' rules"]


def test_a_battery_that_runs_low_is_told_once_and_before_what_follows_from_it() -> None:
    said = [("pilot", False), ("pilot", False), ("surface", True), ("surface", True)]
    records: list[Record] = [
        page(seq, "vehicle", {"rules": rules, "is_low": low}, node)
        for seq, (rules, low) in enumerate(said)
        for node in ("urov", "topside")
    ]
    assert told(flight([{}] * 4), records) == ["1 battery low", "1 'surface' rules"]


def test_no_more_is_told_than_there_is_room_for() -> None:
    values = [{"broken_T1": float(i % 2)} for i in range(40)]
    assert len(told(flight(values))) == MOMENTS_MAX
