"""The view of a run, read back from its file: rows, order, exact numbers, and unusual traces."""

from __future__ import annotations

import contextlib
import errno
import http.client
import os
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import quote, urlsplit

import msgspec
import numpy as np
import pytest

from snr_sim.prelude.errors import MissingExtraError, TraceError
from snr_sim.prelude.task import Page
from snr_sim.recording.columns import Batch
from snr_sim.recording.records import (
    BeginRecord,
    EndRecord,
    ErrorRecord,
    HandlerCall,
    Header,
    InputRecord,
    LogLineRecord,
    PageRecord,
    Record,
    ReturnedTask,
    TaskRecord,
    TruthRecord,
)
from snr_sim.recording.trace import TraceWriter
from snr_sim.view import view, view_server

rr = pytest.importorskip("rerun")
from rerun.chunk import RrdReader  # noqa: E402

only_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks the kernel who listens where")
LOOPBACK_IN_PROC = "0100007F"  # 127.0.0.1, as /proc/net/tcp has it
READ_MESSAGES = "/rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages"
NONE = msgspec.Raw(b"[]")
SCENE = {
    "statics": {
        "ground": {
            "kind": "mesh",
            "vertices_m": [[-50.0, -5.0, 0.0], [50.0, -5.0, 0.0], [0.0, 5.0, 0.0]],
            "triangles": [[0, 1, 2]],
            "rgb": [90, 90, 90],
        },
        "of a later version": {"kind": "cloud"},
    },
    "bodies": {
        "module": [
            {"kind": "box", "half_size_m": [2.0, 2.0, 1.0], "center_m": [0.0, 0.0, 0.0], "rgb": [200, 160, 60]},
            {"kind": "polyline", "points_m": [[1.0, 0.0, -1.0], [2.0, 0.0, -2.0]], "rgb": [9, 9, 9], "radius_m": 0.1},
        ]
    },
}


@pytest.fixture(autouse=True)
def _rerun_is_strict() -> Iterator[None]:
    """Otherwise a wrong argument to rerun is a warning, and rows are missing."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def header(**changes: Any) -> Header:
    fields: dict[str, Any] = {
        "version": "0.1.0", "python": "3.11", "platform": "here", "packages": {"pymunk": "7"},
        "scenario": "drop", "robot": "lander", "controller": "coast", "roles": ["lander"], "engine": "closed form",
        "io": "sim", "seed": 3, "options": {}, "nodes": ["lander"], "clock": "sim", "commands": {}, "sources": {},
        "scene": SCENE,
    }  # fmt: skip
    return Header(**(fields | changes))


def page(seq: int, key: str, data: Any, node: str = "lander", cause: int = 1) -> PageRecord:
    raw = b"[" + Page(key, data, node, seq * 0.1).serialize() + b"]"
    made = [HandlerCall("node_core", "store", [ReturnedTask("process_data", key, NONE)])]
    return PageRecord(seq, seq * 0.1, node, "store_page", key, msgspec.Raw(raw), cause, 0, made)


def truth(seq: int, z: float, thrust_n: float | None = None) -> TruthRecord:
    vectors = {} if thrust_n is None else {"thrust": [0.0, 0.0, z - 1.0, 0.0, 0.0, thrust_n]}
    return TruthRecord(seq, seq * 0.1, {"module": [1.0, 0.0, z, 0.0, 0.0, 0.0, 1.0]}, vectors, {"altitude_m": z})


def fall(ticks: int) -> list[Record]:
    """A short run: for each tick truth, an input, the page that it stores, and what a handler makes of it."""
    records: list[Record] = [BeginRecord(1, 0.0, "lander", "guidance", [ReturnedTask("event", "start", NONE)])]
    for k in range(ticks):
        seq = 2 + 5 * k
        z = 100.0 - 1.62 / 2 * (0.1 * k) ** 2
        stored = page(seq + 2, "radar", {"altitude_m": z + 1 / 3, "is_locked": True}, cause=seq + 1)
        made = [HandlerCall("guidance", "steer", [ReturnedTask("store_page", "engine", NONE)])]
        records += [
            truth(seq, z, 45e3 if k % 3 else None),
            InputRecord(seq + 1, stored.t, "lander", "radar_sensor", "store_page", "radar", stored.values),
            stored,
            TaskRecord(seq + 3, stored.t, "lander", "process_data", "radar", NONE, seq + 2, 0, made),
            page(seq + 4, "engine", {"throttle": 0.1 * k}, cause=seq + 3),
        ]
    last = records[-1].seq
    records.append(ErrorRecord(last + 1, 9.0, "lander", last, "guidance", "ZeroDivisionError: in steer"))
    records.append(EndRecord(last + 2, 9.0, "lander", "landed", {}))
    return records


Rows = dict[str, list[tuple[int, int, list[Any]]]]


def read_rows(path: Path, component: str) -> Rows:
    """Return for each entity its rows of one component: seq, sim_time [ns], values."""
    import pyarrow as pa

    rows: Rows = {}
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        if component not in batch.schema.names or "seq" not in batch.schema.names:
            continue
        seqs = batch.column("seq").to_pylist()
        times = batch.column("sim_time").cast(pa.int64()).to_pylist()
        values = batch.column(component).to_pylist()
        rows.setdefault(str(chunk.entity_path), []).extend(zip(seqs, times, values, strict=True))
    return {entity: sorted(found, key=lambda row: row[0]) for entity, found in rows.items()}


def numbers(path: Path) -> Rows:
    return read_rows(path, "Scalars:scalars")


def entities(path: Path) -> set[str]:
    return {str(chunk.entity_path) for chunk in RrdReader(str(path)).stream()}


def written(tmp_path: Path, records: list[Record], **changes: Any) -> Path:
    path = tmp_path / "view.rrd"
    view.write_view(header(**changes), records, path, 1000)
    return path


# -- what is in a view


def test_truth_and_estimates_round_trip_to_the_bit(tmp_path: Path) -> None:
    records = fall(40)
    found = numbers(written(tmp_path, records))
    truths = [record for record in records if isinstance(record, TruthRecord)]
    assert found["/truth/altitude_m"] == [
        (record.seq, round(record.t * 1e9), [record.values["altitude_m"]]) for record in truths
    ]
    assert [values for _, _, values in found["/truth/poses/module"]] == [record.poses["module"] for record in truths]
    assert [v[0] for _, _, v in found["/lander/pages/radar/altitude_m"]] == [
        record.values["altitude_m"] + 1 / 3 for record in truths
    ]
    assert {values[0] for _, _, values in found["/lander/pages/radar/is_locked"]} == {1.0}


def test_task_log_has_one_line_per_executed_task_in_order(tmp_path: Path) -> None:
    records = fall(20)
    path = written(tmp_path, records)
    texts = read_rows(path, "TextLog:text")["/lander/tasks"]
    levels = read_rows(path, "TextLog:level")["/lander/tasks"]
    executed = [record for record in records if isinstance(record, (TaskRecord, PageRecord))]
    assert [seq for seq, _, _ in texts] == [record.seq for record in executed]
    first, second = texts[0][2][0].split(), texts[1][2][0]
    assert first[:6] == ["4", "store_page", "radar", "<-", "3", "radar_sensor"]
    assert "process_data" in second
    assert "<- 4" in second
    assert "guidance: store_page engine" in second
    assert [level[0] for _, _, level in levels[:3]] == ["INFO", "DEBUG", "DEBUG"]


def test_page_contents_include_text_and_writer(tmp_path: Path) -> None:
    rows = read_rows(written(tmp_path, fall(20)), "TextDocument:text")["/lander/contents"]
    assert len(rows) == 11
    assert "stored by guidance.steer in process_data radar (100)\n    throttle             1.9" in rows[-1][2][0]


def test_error_is_logged_with_level_error(tmp_path: Path) -> None:
    path = written(tmp_path, fall(2))
    texts = read_rows(path, "TextLog:text")["/lander/events"]
    levels = read_rows(path, "TextLog:level")["/lander/events"]
    assert [level[0] for _, _, level in levels] == ["INFO", "ERROR", "INFO"]
    assert texts[1][2] == ["guidance: ZeroDivisionError: in steer"]


def test_lines_that_components_print_and_log_are_among_the_events(tmp_path: Path) -> None:
    printed = LogLineRecord(98, 9.0, "lander", 1, "guidance", "PRINT", "at work")
    logged = LogLineRecord(99, 9.0, "lander", 1, "guidance", "WARNING", "soon over")
    path = written(tmp_path, [*fall(2), printed, logged])
    texts = read_rows(path, "TextLog:text")["/lander/events"]
    levels = read_rows(path, "TextLog:level")["/lander/events"]
    shown = [(level[0], text[0]) for (_, _, level), (_, _, text) in zip(levels, texts, strict=True)]
    assert shown[-2:] == [("INFO", "guidance: at work"), ("WARNING", "guidance: soon over")]


def test_removed_arrow_disappears(tmp_path: Path) -> None:
    path = written(tmp_path, [truth(1, 9.0, 500.0), truth(2, 8.0), truth(3, 7.0), truth(4, 6.0, 250.0)])
    vectors = read_rows(path, "Arrows3D:vectors")["/world/arrows/thrust/newtons"]
    assert [(seq, values) for seq, _, values in vectors] == [
        (1, [[0.0, 0.0, 500.0]]),
        (2, []),
        (4, [[0.0, 0.0, 250.0]]),
    ]


def test_longest_arrow_equals_body_length(tmp_path: Path) -> None:
    path = written(tmp_path, fall(5))
    scales = []
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path == "/world/arrows/thrust/newtons" and "Transform3D:scale" in batch.schema.names:
            scales += batch.column("Transform3D:scale").to_pylist()
    assert scales[-1][0] == pytest.approx([4.0 / 45e3] * 3, rel=1e-6)


def test_scene_is_included_and_unknown_shape_is_skipped(tmp_path: Path) -> None:
    found = entities(written(tmp_path, fall(3)))
    assert {"/world/ground", "/world/module/shapes", "/world/path/module", "/run"} <= found


def test_states_of_machines_are_steps_of_a_line(tmp_path: Path) -> None:
    def transition(seq: int, value: Any) -> TaskRecord:
        raw = msgspec.Raw(msgspec.json.encode([value]))
        return TaskRecord(seq, 0.1 * seq, "lander", "event", "landing.transition", raw, seq - 1, 0, [])

    changes = [{"machine": "landing/in", "target": target} for target in ("coasting", "burning", "coasting")]
    records: list[Record] = [transition(i + 1, one) for i, one in enumerate([*changes, {"machine": "x"}, 5, "text"])]
    path = written(tmp_path, records)
    found = numbers(path)["/lander/machines/landing/in"]
    assert [(seq, values) for seq, _, values in found] == [(1, [0.0]), (2, [1.0]), (3, [0.0])]
    assert "/lander/machines/x" not in entities(path)
    names = [
        name
        for chunk in RrdReader(str(path)).stream()
        if str(chunk.entity_path) == "/lander/machines/landing/in"
        for batch in [chunk.to_record_batch()]
        if "SeriesLines:names" in batch.schema.names
        for (name,) in batch.column("SeriesLines:names").to_pylist()
    ]
    assert names == ["landing/in: 0 coasting, 1 burning"]


def beginnings(path: Path) -> tuple[list[int], list[int]]:
    """Return where the layouts in a file begin, and where its run does."""
    reader, content = RrdReader(str(path)), path.read_bytes()
    layouts, runs = reader.blueprints(), reader.recordings()
    first = [[content.index(one.recording_id.encode()) for one in some] for some in (layouts, runs)]
    return first[0], first[1]


@pytest.mark.parametrize("is_comparison", [False, True])
def test_file_begins_with_layout(tmp_path: Path, is_comparison: bool) -> None:
    path = tmp_path / "view.rrd"
    if is_comparison:
        view.write_comparison(header(), fall(10), fall(10), [], path, 1000)
    else:
        view.write_view(header(), fall(30), path, 1000)
    layouts, runs = beginnings(path)
    assert len(layouts) == len(runs) == 1
    assert layouts < runs


def test_long_run_begins_with_layout_and_ends_with_final_layout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(view, "BATCH_RECORDS", 7)
    layouts, (run,) = beginnings(written(tmp_path, fall(30)))
    assert len(layouts) == 2
    assert min(layouts) < run < max(layouts)


def test_nodes_have_separate_roots(tmp_path: Path) -> None:
    records: list[Record] = [page(1, "depth", 1.5, "topside"), page(2, "depth", 2.5, "sub node")]
    found = numbers(written(tmp_path, records, nodes=["topside", "sub node"]))
    assert found["/topside/pages/depth"][0][2] == [1.5]
    assert found["/sub\\ node/pages/depth"][0][2] == [2.5]


def test_same_trace_makes_view_with_same_rows(tmp_path: Path) -> None:
    first, second = tmp_path / "first.rrd", tmp_path / "second.rrd"
    for path in (first, second):
        view.write_view(header(), fall(30), path, 1000)
    assert numbers(first) == numbers(second)
    assert read_rows(first, "TextLog:text") == read_rows(second, "TextLog:text")
    assert entities(first) == entities(second)


# -- odd traces


def test_run_without_records_has_view(tmp_path: Path) -> None:
    path = written(tmp_path, [], scene={})
    assert entities(path) >= {"/run"}


def test_nan_and_infinity_are_kept(tmp_path: Path) -> None:
    records: list[Record] = [page(k, "sonar", {"range_m": value}) for k, value in enumerate((1.0, np.nan, np.inf), 1)]
    values = [row[2][0] for row in numbers(written(tmp_path, records))["/lander/pages/sonar/range_m"]]
    assert values[0] == 1.0
    assert np.isnan(values[1])
    assert values[2] == np.inf


def test_text_and_missing_values_leave_gaps(tmp_path: Path) -> None:
    datas = [{"a": 1, "s": "x"}, {"s": "y"}, {"a": None}, {"a": "now text"}, {"a": [1.0, 2.0]}, {"a": 5, "late": True}]
    found = numbers(written(tmp_path, [page(k, "p", data) for k, data in enumerate(datas, 1)]))
    assert [(seq, v) for seq, _, v in found["/lander/pages/p/a"]] == [(1, [1.0]), (6, [5.0])]
    assert [(seq, v) for seq, _, v in found["/lander/pages/p/a/1"]] == [(5, [2.0])]
    assert [(seq, v) for seq, _, v in found["/lander/pages/p/late"]] == [(6, [1.0])]
    assert "/lander/pages/p/s" not in found


def test_arrays_tuples_and_huge_integers_are_plotted(tmp_path: Path) -> None:
    datas: list[Any] = [{"v": np.array([0.1, 0.2])}, {"v": (0.3, 0.4)}, {"v": [0.5, 10**400]}]
    found = numbers(written(tmp_path, [page(k, "p", data) for k, data in enumerate(datas, 1)]))
    assert [v[0] for _, _, v in found["/lander/pages/p/v/0"]] == [0.1, 0.3, 0.5]
    assert found["/lander/pages/p/v/1"][-1][2] == [np.inf]


def test_long_list_is_not_plotted(tmp_path: Path) -> None:
    records: list[Record] = [page(1, "scan", {"ranges_m": [1.0] * 500, "count": 500})]
    assert set(numbers(written(tmp_path, records))) == {"/lander/pages/scan/count"}


def test_invalid_page_does_not_hide_others(tmp_path: Path) -> None:
    broken = msgspec.structs.replace(page(2, "p", 1.0), values=msgspec.Raw(b'[{"$":"page","key":"p"}]'))
    not_a_page = msgspec.structs.replace(page(3, "p", 1.0), values=msgspec.Raw(b'["$", 7]'))
    found = numbers(written(tmp_path, [page(1, "p", 1.5), broken, not_a_page, page(4, "p", 2.5)]))
    assert [(seq, v) for seq, _, v in found["/lander/pages/p"]] == [(1, [1.5]), (4, [2.5])]


def test_undecodable_object_is_skipped(tmp_path: Path) -> None:
    found = numbers(written(tmp_path, [page(1, "p", {"x": object()}), page(2, "p", {"x": 3.0})]))
    assert [(seq, v) for seq, _, v in found["/lander/pages/p/x"]] == [(2, [3.0])]


def test_run_is_processed_in_batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(view, "BATCH_RECORDS", 7)
    held: list[int] = []
    extend = Batch.extend
    monkeypatch.setattr(Batch, "extend", lambda self, some: (held.append(len(list(some))), extend(self, some))[1])
    split = written(tmp_path, fall(30))
    assert max(held) == 7
    monkeypatch.undo()
    whole = tmp_path / "whole.rrd"
    view.write_view(header(), fall(30), whole, 1000)
    assert numbers(split) == numbers(whole)
    assert read_rows(split, "TextLog:text") == read_rows(whole, "TextLog:text")


def test_unwritable_path_raises_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="no such folder"):
        view.write_view(header(), [], tmp_path / "no such folder" / "view.rrd", 1000)


def test_missing_view_is_derived_from_trace_and_kept(tmp_path: Path) -> None:
    recorder = TraceWriter(tmp_path / "trace.jsonl", header())
    recorder.close()
    found = view.view_of(tmp_path)
    assert found == tmp_path / "view.rrd"
    assert entities(found) >= {"/run"}
    found.write_bytes(b"kept")
    assert view.view_of(tmp_path).read_bytes() == b"kept"
    assert view.view_of(found) == found


def test_view_older_than_trace_is_rebuilt(tmp_path: Path) -> None:
    TraceWriter(tmp_path / "trace.jsonl", header()).close()
    found = view.view_of(tmp_path)
    found.write_bytes(b"of half the run")
    os.utime(found, (1.0, 1.0))
    assert entities(view.view_of(tmp_path)) >= {"/run"}


def test_interrupted_view_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(self: Any, *given: Any) -> None:
        self._path.write_bytes(b"half")
        raise KeyboardInterrupt

    TraceWriter(tmp_path / "trace.jsonl", header()).close()
    monkeypatch.setattr(view.ViewFile, "send", interrupted)
    with pytest.raises(KeyboardInterrupt):
        view.view_of(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["trace.jsonl"]


@pytest.mark.parametrize(
    "write",
    [
        lambda path: view.write_view(header(), fall(3), path, 5_000_000),
        lambda path: view.write_comparison(header(), fall(3), fall(3), [], path, 5_000_000),
    ],
    ids=["of a run", "of two runs"],
)
def test_view_without_disk_space_raises_before_writing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: Callable[[Path], None]
) -> None:
    asked: list[int] = []

    def full(descriptor: int, offset: int, length: int) -> None:
        asked.append(length)
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "view.rrd"
    path.write_bytes(b"of before")
    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(TraceError, match=r"view\.rrd cannot be written: No space left on device"):
        write(path)
    assert asked == [view.MAX_VIEW_RATIO * 5_000_000 + view.MIN_VIEW_BYTES]
    assert path.read_bytes() == b"of before"
    assert list(tmp_path.iterdir()) == [path]


def test_missing_rerun_raises_with_install_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingExtraError, match=r"snr_sim\[view\]"):
        view.write_view(header(), [], tmp_path / "view.rrd", 1000)


# -- two runs side by side


def test_comparison_contains_both_runs_and_difference_marks(tmp_path: Path) -> None:
    path = tmp_path / "compare.rrd"
    divergences = [(7, 0.7, "engine.throttle: 0.1 recorded, 0.2 replayed"), (9, 0.9, "another")]
    view.write_comparison(header(), fall(10), fall(10)[:-4], divergences, path, 1000)
    found = numbers(path)
    assert found["/recorded/truth/altitude_m"] == found["/replayed/truth/altitude_m"]
    assert [seq for seq, _, _ in found["/divergences/marks"]] == [7, 9]
    assert read_rows(path, "TextLog:text")["/divergences"][0][2] == [divergences[0][2]]
    assert "/recorded/world/ground" in entities(path)


def test_comparison_accepts_separate_roots_and_scenes(tmp_path: Path) -> None:
    path = tmp_path / "compare.rrd"
    bare = msgspec.structs.replace(header(), scene={})
    view.write_comparison(header(), fall(3), fall(3), [], path, 1000, ("first", "second"), bare)
    found = entities(path)
    assert {"/first/world/ground", "/second/truth/altitude_m"} <= found
    assert "/second/world/ground" not in found


def test_identical_runs_have_no_marks(tmp_path: Path) -> None:
    path = tmp_path / "compare.rrd"
    view.write_comparison(header(), fall(3), fall(3), [], path, 1000)
    assert not any(entity.startswith("/divergences") for entity in entities(path))


# -- live, and in the browser: from this machine only


def children_of(pid: int) -> list[int]:
    """Return the processes that a process has started, and those that they have."""
    own = [int(child) for tasks in Path(f"/proc/{pid}/task").glob("*/children") for child in tasks.read_text().split()]
    return own + [grandchild for child in own for grandchild in children_of(child)]


def listening_addresses(pid: int) -> set[str]:
    """Return the addresses, as the kernel writes them, on which a process and its children listen."""
    sockets = set()
    for one in [pid, *children_of(pid)]:
        for link in Path(f"/proc/{one}/fd").iterdir():
            with contextlib.suppress(OSError):
                sockets.add(str(Path(link).readlink()))
    rows = [line.split() for name in ("tcp", "tcp6") for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]]
    return {row[1].split(":")[0] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in sockets}


@pytest.mark.slow
@only_linux
def test_live_view_listens_on_loopback_only() -> None:
    live = view.LiveView(header())
    try:
        for record in fall(5):
            live.add(record)
        live.flush()
        assert live.url.startswith("rerun+http://127.0.0.1:")
        assert listening_addresses(os.getpid()) == {LOOPBACK_IN_PROC}
    finally:
        live.close()
        live.close()  # safe to call twice


@pytest.mark.slow
def test_close_of_live_view_returns_though_the_viewer_does_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(view, "LIVE_TIMEOUT_S", 0.2)
    live = view.LiveView(header())
    stream, is_read = live._stream, threading.Event()
    live._stream = SimpleNamespace(flush=lambda **_: None, send_blueprint=lambda _: None, disconnect=is_read.wait)
    began_s = time.monotonic()
    live.close()
    assert 0.2 <= time.monotonic() - began_s < 3.0
    is_read.set()
    stream.disconnect()


@pytest.mark.slow
@only_linux
def test_page_is_served_on_loopback_with_content_security_policy(tmp_path: Path) -> None:
    path = written(tmp_path, fall(3))
    with view_server.serve_web(path) as url:
        assert url.startswith("http://127.0.0.1:")
        assert listening_addresses(os.getpid()) == {LOOPBACK_IN_PROC}
        page_url = url.split("?")[0]
        with urllib.request.urlopen(page_url, timeout=60) as answer:
            policy = answer.headers["Content-Security-Policy"]
            assert "canvas" in answer.read().decode()
        with urllib.request.urlopen(page_url + view_server.FILE_NAME, timeout=60) as answer:
            assert answer.read() == path.read_bytes()
    sources = {word for rule in policy.split(";") for word in rule.split()[1:]}
    assert {source for source in sources if "://" in source} == {"http://127.0.0.1:*"}
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(page_url, timeout=5)


@pytest.mark.slow
@only_linux
def test_live_view_allows_only_the_pages_origin() -> None:
    live = view.LiveView(header())
    try:
        for record in fall(5):
            live.add(record)
        live.flush()
        with view_server.serve_web(live.url) as url:
            assert quote(live.url, safe="") in url
            stream = urlsplit(live.url.removeprefix("rerun+")).netloc
            for origin, answers in (("http://" + urlsplit(url).netloc, True), ("http://evil.example", False)):
                asked = http.client.HTTPConnection(stream, timeout=60)
                headers = {"Origin": origin, "Content-Type": "application/grpc-web+proto", "X-Grpc-Web": "1"}
                asked.request("POST", READ_MESSAGES, body=bytes(5), headers=headers)
                answer = asked.getresponse()
                assert (answer.getheader("access-control-allow-origin") == origin) is answers
                assert len(answer.read(1000)) == 1000
                asked.close()
    finally:
        live.close()


def test_viewer_environment_disables_statistics(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_RERUN_ANALYTICS", "1")
    environment = view_server.viewer_environment()
    assert environment["CI"] == "1"
    assert "FORCE_RERUN_ANALYTICS" not in environment
    assert environment["RUST_LOG"] == "error"


def test_missing_view_raises_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match=r"nothing\.rrd"):
        view_server.open_view(tmp_path / "nothing.rrd", web=True)


@pytest.mark.slow
@only_linux
def test_viewer_failure_suggests_browser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = r"printf 'log\n\033[31mError: no graphics driver\033[0m\n' >&2; exit 3"
    monkeypatch.setattr(view_server, "viewer_command", lambda: ["sh", "-c", script])
    monkeypatch.setenv("DISPLAY", ":0")
    with pytest.raises(TraceError, match="--web") as failed:
        view_server.open_view(written(tmp_path, fall(1)))
    assert failed.value.message == "The viewer ended with status 3; its last words: Error: no graphics driver"


def test_window_without_display_raises_and_suggests_browser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    (tmp_path / "view.rrd").touch()
    with pytest.raises(TraceError, match="there is no display") as refused:
        view_server.open_view(tmp_path / "view.rrd")
    assert refused.value.fix == "snr view RUN --web shows it in a browser."
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    view_server.check_display("snr view", "")


@pytest.mark.slow
@only_linux
def test_ctrl_c_ends_page_and_its_processes(tmp_path: Path) -> None:
    path = written(tmp_path, fall(3))
    code = f"from snr_sim.view.view_server import open_view; open_view({str(path)!r}, web=True)"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert "http://127.0.0.1:" in process.stdout.readline()
        children = children_of(process.pid)
        assert children
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 0
        deadline_s = time.monotonic() + 60
        while any(Path(f"/proc/{child}").exists() for child in children):
            assert time.monotonic() < deadline_s
    finally:
        process.kill()
        process.wait()
        if process.stdout:
            process.stdout.close()
