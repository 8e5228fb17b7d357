"""Readers return the valid items of a file in order, and report what they skipped."""

import math
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import (
    MemoryLink,
    Node,
    Page,
    PageReader,
    ReplayerLoopFactory,
    SimClock,
    StopwatchEndpointFactory,
    TaskType,
    TextReader,
)
from snr_sim.core.config import Config
from snr_sim.core.runners import SimRunner
from snr_sim.prelude.errors import RecordingError
from snr_sim.recording.replayers import ListReplayerFactory
from snr_sim.recording.trace import TraceWriter
from snr_sim.scenario.program import program_header


def page(data: Any, created_at_s: float = 0.0, origin: str = "a_node", key: str = "x") -> bytes:
    return Page(key, data, origin, created_at_s).serialize()


def times(file: Path, *lines: bytes) -> list[tuple[float, Any]]:
    file.write_bytes(b"\n".join(lines) + b"\n")
    reader = PageReader(file)
    return [(stored.time_s, stored.page.data) for stored in iter(reader.read_stored, None)]


def test_the_lines_of_a_text_come_in_order_without_their_ends(tmp_path: Path) -> None:
    file = tmp_path / "moves.txt"
    file.write_bytes(b"forward\r\n\nleft\xff\nlast without an end")
    reader = TextReader(file)
    assert list(reader) == ["forward", "", "left\ufffd", "last without an end"]
    assert reader.read() is None
    reader.close()
    reader.close()


@pytest.mark.parametrize("kind", [TextReader, PageReader])
def test_the_end_of_a_with_closes_the_file(tmp_path: Path, kind: Any) -> None:
    (tmp_path / "x").write_bytes(page("first") + b"\n" + page("second") + b"\n")
    with kind(tmp_path / "x") as reader:
        assert reader.read() is not None
    assert reader.read() is None


@pytest.mark.parametrize("kind", [TextReader, PageReader])
def test_arguments_of_2021_are_rejected(kind: Any) -> None:
    with pytest.raises(RecordingError, match=r"(?s)object.* where its file belongs.*the file first"):
        kind(object(), "reader", "moves.txt")


# In the format of the 2021 library's recorder: json.dumps of a page's fields, including NaN.
OF_2021 = (
    b'{"key": "raw", "data": [1, 2.5, "\\u00e9"], "origin": "test_node", "created_at_s": 0.25, "process": true}',
    b'{"key": "depth", "data": NaN, "origin": "test_node", "created_at_s": 0.5, "process": false}',
    b'{"key": "x", "data": {"$": "tuple", "v": [1]}, "origin": "other_node", "created_at_s": 1, "process": true}',
)


def test_a_recording_of_the_2021_library_is_read(tmp_path: Path) -> None:
    file = tmp_path / "old.txt"
    file.write_bytes(b"\n".join(OF_2021) + b"\n")
    with PageReader(file) as reader:
        raw, depth, marked = reader
    assert raw == Page("raw", [1, 2.5, "é"], "test_node", 0.25)
    assert math.isnan(depth.data)
    assert (depth.key, depth.created_at_s, depth.process) == ("depth", 0.5, False)
    assert marked == Page("x", {"$": "tuple", "v": [1]}, "other_node", 1.0)  # data, however they look
    assert reader.warnings == []


def test_a_recording_of_the_2021_library_is_replayed_at_its_times(tmp_path: Path) -> None:
    (tmp_path / "old.txt").write_bytes(b"\n".join(OF_2021) + b"\n")
    times_s: list[float] = []
    replayer = ReplayerLoopFactory(str(tmp_path / "old.txt"), exit=True)
    stopwatch = StopwatchEndpointFactory(times_s, [TaskType.store_page])
    node = Node("r", Config(factories={"r": [replayer, stopwatch]}), clock=SimClock())
    node.loop()
    assert times_s == [0.25, 0.5, 1.0]


@pytest.mark.parametrize(
    "damage",
    [
        b'{"key": "x", "data": 1, "origin": "a_node"}',
        b'{"key": "x", "data": 1, "origin": "a_node", "created_at_s": "soon"}',
        b'{"key": 5, "data": 1, "origin": "a_node", "created_at_s": 0.0}',
        b'{"key": "x", "data": 1, "origin": "a_node", "created_at_s": 0.0, "more": 1}',
        b'{"key": "x", "data": 1, "orig',
        b'{"key": "x", "data": ' + b"[" * 100_000,
        b'{"key": "x", "data": ' + b"9" * 10_000 + b', "origin": "a_node", "created_at_s": 0.0}',
    ],
)
def test_invalid_page_in_recording_of_2021_is_skipped_with_warning(tmp_path: Path, damage: bytes) -> None:
    file = tmp_path / "old.txt"
    file.write_bytes(b"\n".join([OF_2021[0], damage, OF_2021[0], b""]))
    reader = PageReader(file)
    assert [page.key for page in reader] == ["raw", "raw"]
    assert len(reader.warnings) == 1


def test_empty_lines_of_pages_are_counted_and_named(tmp_path: Path) -> None:
    file = tmp_path / "x.jsonl"
    file.write_bytes(b"\n".join([page(1), b"", b" \r", page(2), b""]))
    reader = PageReader(file)
    assert [page.data for page in reader] == [1, 2]
    assert [one.partition(", ")[2] for one in reader.warnings] == [
        "line 2 was left out: It is empty.",
        "line 3 was left out: It is empty.",
    ]


@pytest.mark.parametrize("kind", [TextReader, PageReader])
def test_missing_file_is_named(tmp_path: Path, kind: Any) -> None:
    with pytest.raises(RecordingError, match=r"none\.txt cannot be read: No such file"):
        kind(tmp_path / "none.txt")


@pytest.mark.parametrize(
    "damage",
    [b"", b"{", page(1)[:-1], b"17", b'{"key":"x"}', b"\xff\xfe", b'{"$":"start"}', b'{"kind":"page"}', b"[" * 100_000],
)
def test_invalid_page_is_skipped_with_warning_and_rest_is_read(tmp_path: Path, damage: bytes) -> None:
    file = tmp_path / "x.jsonl"
    file.write_bytes(b"\n".join([page(1), damage, page(2), b""]))
    reader = PageReader(file)
    assert [page.data for page in reader] == [1, 2]
    assert len(reader.warnings) == 1
    assert "line 2 was left out" in reader.warnings[0]


def test_file_of_other_format_gives_few_warnings(tmp_path: Path) -> None:
    file = tmp_path / "letter.txt"
    file.write_text("Dear Sir or Madam,\n" * 500)
    reader = PageReader(file)
    assert list(reader) == []
    assert len(reader.warnings) == 4
    assert "497 more lines" in reader.warnings[-1]


@given(st.lists(st.tuples(st.sampled_from("abc"), st.integers()), max_size=20))
def test_only_requested_keys_are_read(stored: list[tuple[str, int]]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "x.jsonl"
        file.write_bytes(b"".join(page(data, key=key) + b"\n" for key, data in stored))
        assert [one.data for one in PageReader(file, ["a", "c"])] == [data for key, data in stored if key != "b"]
        assert [one.data for one in PageReader(file, "b")] == [data for key, data in stored if key == "b"]


def test_pages_were_stored_when_they_were_made(tmp_path: Path) -> None:
    assert times(tmp_path / "x", page("a", 0.1), page("b", 0.35)) == [(0.1, "a"), (0.35, "b")]


def test_second_start_follows_first_in_time(tmp_path: Path) -> None:
    start = b'{"$":"start","node":"a_node"}'
    lines = [start, page("a", 0.5), page("b", 2.0), start, page("c", 0.25), page("d", 1.0)]
    assert times(tmp_path / "x", *lines) == [(0.5, "a"), (2.0, "b"), (2.25, "c"), (3.0, "d")]


def test_the_clock_of_another_node_does_not_stretch_the_time(tmp_path: Path) -> None:
    start = b'{"$":"start","node":"a_node"}'
    lines = [start, page("a", 1.0), page("b", 5000.0, "b_node"), page("c", 1.5), page("d", 5002.0, "b_node")]
    assert times(tmp_path / "x", *lines) == [(1.0, "a"), (1.0, "b"), (1.5, "c"), (3.0, "d")]


def test_page_with_invalid_stamp_takes_time_of_previous_page(tmp_path: Path) -> None:
    no_time = b'{"$":"page","key":"x","data":"b","origin":"a_node","created_at_s":{"$":"float","v":"inf"}}'
    assert times(tmp_path / "x", page("a", 1.0), no_time, page("c", 2.0)) == [(1.0, "a"), (1.0, "b"), (2.0, "c")]


def test_trace_pages_have_storage_times_of_requested_node(tmp_path: Path) -> None:
    file = tmp_path / "trace.jsonl"
    config = Config(factories={"a": [ListReplayerFactory([1, 2], "x", rate_hz=4)], "b": [ListReplayerFactory([], "y")]})
    clock = SimClock()
    writer = TraceWriter(file, program_header(["a", "b"], config, __file__, clock))
    SimRunner(config, links=[MemoryLink(["x"], "a", "b", latency_s=0.125)], clock=clock, recorder=writer).run()
    writer.close()
    assert [page.data for page in PageReader(file, "x")] == [1, 1, 2, 2]
    arrived = PageReader(file, "x", node="b_node")
    stored = list(iter(arrived.read_stored, None))
    assert [(one.time_s, one.page.data, one.page.created_at_s) for one in stored] == [(0.125, 1, 0.0), (0.375, 2, 0.25)]
    assert arrived.warnings == []


def test_trace_pages_without_their_cause_or_values_are_skipped(tmp_path: Path) -> None:
    file = tmp_path / "trace.jsonl"
    whole = b'{"kind":"input","seq":1,"t":0.5,"node":"a","source":"s","type":"store_page","name":"x","values":[%s]}'
    lines = [whole % page(1), b'{"kind":"page","seq":2,"cause":1}', b'{"kind":"page","seq":3,"cause":1}', whole % b""]
    file.write_bytes(b"\n".join([*lines, b'{"kind":"page","seq":4,"cause":1}', b""]))
    with PageReader(file) as reader:
        assert [one.data for one in reader] == [1]
    assert [one.partition(", ")[2] for one in reader.warnings] == [
        "line 3 was left out: This is not a page (record 3 refers to task 0 of record 1, which is not there or was "
        "executed).",
        "line 5 was left out: This is not a page (list index out of range).",
    ]
