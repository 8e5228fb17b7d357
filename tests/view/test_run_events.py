"""Events of a run, as text."""

from __future__ import annotations

import msgspec
import numpy as np

from snr_sim.prelude.task import Page
from snr_sim.recording.columns import Batch
from snr_sim.recording.records import PageRecord, Record
from snr_sim.view.picture_tracks import BodyTracks
from snr_sim.view.run_events import MAX_EVENTS, find_run_events


def tracks(values: list[dict[str, float]], current_mps: list[float] | None = None, to_m: float = 0.0) -> BodyTracks:
    """Along x through the origin's x, half a second each."""
    count = len(values)
    poses = np.zeros((count, 7))
    poses[:, 0], poses[:, 2], poses[:, 6] = np.linspace(-to_m, to_m, count), -1.5, 1.0
    speeds = current_mps or [0.0] * count
    vectors = [{"current": [0.0, 0.0, 0.0, 40.0 * speed, 0.0, 0.0]} if speed else {} for speed in speeds]
    return BodyTracks(0.5 * np.arange(count), {"vehicle": poses}, vectors, values, None)


def page(seq: int, key: str, data: dict[str, object], node: str = "urov", origin: str = "urov") -> PageRecord:
    raw = msgspec.Raw(b"[" + Page(key, data, origin, seq * 0.5).serialize() + b"]")
    return PageRecord(seq, seq * 0.5, node, "store_page", key, raw, 1, 0, [])


def run_events(of: BodyTracks, records: list[Record] | None = None, gate: dict[str, object] | None = None) -> list[str]:
    batch = Batch()
    batch.extend(records or [])
    return [f"{one.time_s:g} {one.text}" for one in find_run_events(of, {"gate_1": gate} if gate else {}, batch)]


def test_failure_leak_and_released_payload_are_events() -> None:
    values = [{"broken_T3": float(i >= 2), "water_l": max(0.0, i - 2.0), "load_kg": 0.5 * (i < 4)} for i in range(6)]
    assert run_events(tracks(values)) == ["1 T3 fails", "1.5 water comes in", "2 payload of 0.5 kg released"]


def test_current_is_event_only_when_it_changes() -> None:
    assert run_events(tracks([{}] * 4, [0.1, 0.1, 0.3, 0.301])) == ["1 current: 0.30 m/s"]
    assert run_events(tracks([{}] * 4, [0.2, 0.2, 0.2, 0.2])) == []


def test_gate_is_event_only_if_path_crosses_it() -> None:
    corners = [[0.3, 1.0, -1.0], [0.3, 1.0, -2.0], [0.3, -1.0, -2.0], [0.3, -1.0, -1.0], [0.3, 1.0, -1.0]]
    gate: dict[str, object] = {"label": "gate 1", "points_m": corners}
    assert run_events(tracks([{}] * 5, to_m=1.0), gate=gate) == ["1.5 through gate 1"]
    beside: dict[str, object] = {**gate, "points_m": [[x, y + 3.0, z] for x, y, z in corners]}
    above: dict[str, object] = {**gate, "points_m": [[x, y, z + 0.8] for x, y, z in corners]}
    assert run_events(tracks([{}] * 5, to_m=1.0), gate=beside) == []
    assert run_events(tracks([{}] * 5, to_m=1.0), gate=above) == []


def test_link_loss_and_return_are_events_once_for_both_ends() -> None:
    records: list[Record] = []
    for seq, is_up in enumerate([False, True, True, False, False, True]):
        link = {"up": is_up, "sent": seq}
        records += [page(seq, "link_tether", link, node, node) for node in ("urov", "topside")]
    assert run_events(tracks([{}] * 6), records) == ["1.5 link is lost", "2.5 link is back"]


def test_control_state_events_ignore_copied_pages() -> None:
    records: list[Record] = [
        page(seq, "vehicle", {"control_state": control_state})
        for seq, control_state in enumerate(["idle", "pilot", "pilot"])
    ]
    copies: list[Record] = [
        page(seq + 9, "vehicle", {"control_state": control_state}, "topside")
        for seq, control_state in enumerate(["idle", "pilot"])
    ]
    assert run_events(tracks([{}] * 3), [*records, *copies]) == ["0.5 'pilot' control state"]


def test_low_battery_is_one_event_before_its_consequence() -> None:
    states = [("pilot", False), ("pilot", False), ("surface", True), ("surface", True)]
    records: list[Record] = [
        page(seq, "vehicle", {"control_state": control_state, "is_battery_low": low}, node)
        for seq, (control_state, low) in enumerate(states)
        for node in ("urov", "topside")
    ]
    assert run_events(tracks([{}] * 4), records) == ["1 battery low", "1 'surface' control state"]


def test_events_are_limited_to_max_events() -> None:
    values = [{"broken_T1": float(i % 2)} for i in range(40)]
    assert len(run_events(tracks(values))) == MAX_EVENTS
