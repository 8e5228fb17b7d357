"""Pages as text in the view: their content, time and source, and the maximum cost."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim.prelude.task import Page
from snr_sim.recording.columns import Batch
from snr_sim.recording.records import (
    BeginRecord,
    HandlerCall,
    InputRecord,
    PageRecord,
    Record,
    ReturnedTask,
    TaskRecord,
)
from snr_sim.view.view_blueprint import Layout, blueprint
from snr_sim.view.view_pages import MAX_CONTENTS_CHARS, MAX_FIELDS_SHOWN, PageContents

NONE = msgspec.Raw(b"[]")


def page(seq: int, t: float, key: str, data: Any, cause: int = 1, index: int = 0) -> PageRecord:
    raw = msgspec.Raw(b"[" + Page(key, data, "urov", t).serialize() + b"]")
    return PageRecord(seq, t, "urov", "store_page", key, raw, cause, index, [])


def contents(records: list[Record], made: PageContents | None = None) -> list[tuple[int, str]]:
    """Return seq and text of each row."""
    batch = Batch()
    batch.extend(records)
    ((node, when, texts),) = (made or PageContents()).of(batch)
    assert node == "urov"
    return list(zip(when.seq.tolist(), texts, strict=True))


def test_page_text_contains_fields_units_and_writer() -> None:
    imu = {"yaw_rad": 1 / 3, "rate_radps": [0.5, 0.25], "is_upright": True, "mode": "hold", "target_m": None}
    made = [HandlerCall("logger", "count", [ReturnedTask("event", "counted", NONE)])]
    made.append(
        HandlerCall(
            "autopilot", "steer", [ReturnedTask("event", "e", NONE), ReturnedTask("store_page", "controls", NONE)]
        )
    )
    records: list[Record] = [
        BeginRecord(1, 0.0, "urov", "autopilot", [ReturnedTask("store_page", "plan", NONE)]),
        page(2, 0.0, "plan", {"legs": {"first": {"depth_m": 3.0}}}),
        InputRecord(3, 0.1, "urov", "imu_sensor", "store_page", "imu", NONE),
        page(4, 0.1, "imu", imu, cause=3),
        TaskRecord(5, 0.1, "urov", "process_data", "imu", NONE, 4, 0, made),
        page(6, 0.1, "controls", 0.5, cause=5, index=2),
        page(7, 0.2, "late", {}, cause=-1),
    ]
    assert contents(records)[-1] == (
        7,
        """plan  at 0.000 s, task 2, stored by autopilot.begin (1)
    legs.first.depth_m   3 m

imu  at 0.100 s, task 4, stored by imu_sensor (3)
    yaw_rad              0.333333 rad
    rate_radps           [0.5, 0.25] rad/s
    is_upright           True
    mode                 'hold'
    target_m             None

controls  at 0.100 s, task 6, stored by autopilot.steer in process_data imu (5)
                         0.5

late  at 0.200 s, task 7, stored by an earlier task (-1)
                         {}""",
    )
    ((_, with_line),) = contents(records, PageContents({"steer": "hold.py line 7"}))[-1:]
    assert "stored by autopilot.steer, hold.py line 7, in process_data imu (5)" in with_line


def test_page_texts_are_sent_once_per_second_with_newest_pages() -> None:
    records: list[Record] = [page(seq, 0.1 * (seq - 1), "depth", {"depth_m": float(seq)}) for seq in range(1, 32)]
    records.insert(1, page(100, 0.0, "leak", {"is_wet": False}))
    records.sort(key=lambda record: (record.t, record.seq))
    ordered = [msgspec.structs.replace(record, seq=seq) for seq, record in enumerate(records, start=1)]
    rows = contents(ordered)
    assert [seq for seq, _ in rows] == [2, 12, 22, 32]
    assert ["    depth_m              11 m" in text for _, text in rows] == [False, True, False, False]
    assert all("is_wet               False" in text for _, text in rows)


def test_page_of_earlier_batch_is_kept() -> None:
    made = PageContents()
    contents([page(1, 0.0, "plan", {"legs": 3})], made)
    ((_, text),) = contents([page(2, 0.1, "imu", {"yaw_rad": 1.0})], made)
    assert "legs                 3" in text
    assert "yaw_rad              1 rad" in text


def test_long_or_deep_values_are_shown_by_size() -> None:
    deep: Any = 1
    for _ in range(100):
        deep = {"in": [deep]}
    scan = {"ranges_m": list(range(1000)), "rgb": np.zeros((3, 4, 3), np.uint8), "deep": deep, "text": "x" * 5000}
    ((_, text),) = contents([page(1, 0.0, "scan", scan)])
    assert "ranges_m             [1000 values] m" in text
    assert "rgb                  array of 3 x 4 x 3, uint8" in text
    assert len(text) < 1000
    ((_, text),) = contents([page(1, 0.0, "many", {f"field_{k}": k for k in range(MAX_FIELDS_SHOWN + 7)})])
    assert text.endswith("    ... and 7 more")
    ((_, text),) = contents([page(k, 0.0, f"page_{k}", {"text": "x" * 150}) for k in range(1, 500)])
    assert len(text) == MAX_CONTENTS_CHARS


def test_each_node_has_view_of_its_pages() -> None:
    rrb = pytest.importorskip("rerun.blueprint")
    layout = Layout("run", logs=["/urov"], contents=["/urov/contents"])
    tabs = blueprint(rrb, layout).root_container.contents[0].contents[0]
    shown = [(type(view).__name__, view.name, view.contents) for view in tabs.contents]
    assert shown[1] == ("TextDocumentView", "pages of urov", ["+ /urov/contents"])
    assert "- /urov/contents" in shown[0][2]
