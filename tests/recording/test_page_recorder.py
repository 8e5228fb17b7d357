"""A recording has each page whole, is only appended to, and its failures never end the robot."""

import errno
import json
import threading
import time
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from snr_sim import (
    Config,
    ListReplayerFactory,
    Node,
    Page,
    PageReader,
    RecorderEndpointFactory,
    SimClock,
    SNRTestCase,
    tasks,
)
from snr_sim.core.lockstep import LockStep
from snr_sim.prelude.errors import ComponentFailedError, ConfigError
from snr_sim.recording import page_recorder
from snr_sim.testing.function_components import FunctionLoopFactory

case = SNRTestCase()
START = '{"$":"start","node":"test_node"}'


def record(file: Path, values: list[Any]) -> Node:
    return case.run_test_node([RecorderEndpointFactory(file, ["x"]), ListReplayerFactory(values, "x", rate_hz=10)])


def test_each_page_is_one_line_as_serialize_writes_it(tmp_path: Path) -> None:
    file = tmp_path / "x.jsonl"
    record(file, [1.5, {"a": [1, 2]}])
    pages = [Page("x", 1.5, "test_node", 0.0), Page("x", {"a": [1, 2]}, "test_node", 0.1)]
    assert file.read_bytes().splitlines() == [START.encode(), *(page.serialize() for page in pages)]


def test_a_line_is_a_start_or_a_page_as_the_schema_says(tmp_path: Path, validator: Any) -> None:
    file = tmp_path / "x.jsonl"
    for values in ([1, (2.5, float("nan"))], [np.arange(3), {"a": None}]):
        record(file, values)
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert [line for line in lines if not validator("page")(line)] == [{"$": "start", "node": "test_node"}] * 2


def test_only_requested_keys_are_recorded(tmp_path: Path) -> None:
    for keys in ("depth", ["depth"]):
        file = tmp_path / f"{len(keys)}.jsonl"
        both = FunctionLoopFactory(
            lambda loop: [loop.store_data(key, 1) for key in ("depth", "d", "heading")], rate_hz=1
        )
        case.run_test_node([RecorderEndpointFactory(file, keys), both], until_s=2)
        assert [page.key for page in PageReader(file)] == ["depth"] * 3


def test_a_line_is_in_the_file_as_soon_as_the_page_is_stored(tmp_path: Path) -> None:
    file = tmp_path / "x.jsonl"
    sizes: list[int] = []
    looks = FunctionLoopFactory(lambda loop: sizes.append(len(file.read_bytes().splitlines())), "looks", rate_hz=10)
    case.run_test_node(
        [RecorderEndpointFactory(file, "x"), ListReplayerFactory([1, 2, 3], "x", rate_hz=10), looks], until_s=0.35
    )
    assert sizes == [2, 3, 4, 4]  # with the line of the start


def test_second_start_continues_same_file(tmp_path: Path) -> None:
    file = tmp_path / "x.jsonl"
    record(file, [1, 2])
    first = file.read_bytes()
    record(file, [3])
    assert file.read_bytes().startswith(first)
    assert [page.data for page in PageReader(file)] == [1, 2, 3]
    assert file.read_text().splitlines().count(START) == 2


def test_start_after_crash_begins_new_line(tmp_path: Path) -> None:
    file = tmp_path / "x.jsonl"
    record(file, [1, 2])
    file.write_bytes(file.read_bytes()[:-20])  # the last line was cut
    record(file, [3])
    reader = PageReader(file)
    assert [page.data for page in reader] == [1, 3]
    assert len(reader.warnings) == 1
    assert "line 3 was left out" in reader.warnings[0]


def test_arrays_survive_with_their_type(tmp_path: Path) -> None:
    file = tmp_path / "x.jsonl"
    values = [np.array([[1, 2], [3, 4]], dtype=np.int64), np.float32(0.1), np.arange(1000.0), (1, float("nan"))]
    node = record(file, values)
    assert node.notes == []
    back = [page.data for page in PageReader(file)]
    assert [value.dtype for value in back[:3]] == [np.int64, np.float32, np.float64]
    np.testing.assert_array_equal(back[0], values[0])
    np.testing.assert_array_equal(back[2], values[2])
    assert repr(back[3]) == "(1, nan)"


class Opaque:
    """An object that JSON cannot encode."""


class Hostile:
    """An object that raises when it is inspected."""

    def __getattribute__(self, name: str) -> Any:
        raise RuntimeError("hands off")


@pytest.mark.parametrize("make", [Opaque, Hostile, lambda: {"deep": [Opaque()]}, lambda: "\ud800"])
def test_unrecordable_page_is_reported_once_and_others_are_recorded(tmp_path: Path, make: Any) -> None:
    file, value = tmp_path / "x.jsonl", make()
    node = record(file, [1, value, value, value, 2])
    assert [page.data for page in PageReader(file)] == [1, 2]
    assert len(node.notes) == 2
    assert "'recorder' could not record page 'x' at t = 0.100 s" in node.notes[0]
    assert node.notes[1] == "'recorder' could not record 3 pages 'x'."


def test_unwritable_recording_raises_at_begin(tmp_path: Path) -> None:
    ticks: list[float] = []
    factories = [
        RecorderEndpointFactory(tmp_path / "no" / "x.jsonl", "x"),
        FunctionLoopFactory(lambda loop: ticks.append(1)),
    ]
    with pytest.raises(ComponentFailedError, match=r"x\.jsonl cannot be written: No such file"):
        case.run_test_node(factories)
    assert ticks == []


class SmallDisk(FileIO):
    """A file on a nearly full disk: it writes what fits."""

    room_bytes = 150

    def write(self, data: Any) -> int:
        if self.room_bytes <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        fits = bytes(data)[: self.room_bytes]
        self.room_bytes -= len(fits)
        return super().write(fits)


def test_full_disk_ends_recording_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "x.jsonl"
    with monkeypatch.context() as context:
        context.setattr(Path, "open", lambda path, mode, buffering: SmallDisk(path, mode))
        node = record(file, [1, 2, 3])
    assert node.get_data("x") == 3
    assert len(node.notes) == 1
    assert "ended its recording" in node.notes[0]
    assert len(file.read_bytes()) == 150
    record(file, [4])
    assert [page.data for page in PageReader(file)] == [1, 4]


class HangingDisk(FileIO):
    """A file on a disk that answers only once it is allowed to."""

    is_asked, may_answer = threading.Event(), threading.Event()

    def write(self, data: Any) -> int:
        self.is_asked.set()
        self.may_answer.wait()
        return super().write(data)


@pytest.mark.slow
@pytest.mark.parametrize("at_most", [0, page_recorder.MAX_UNWRITTEN_BYTES], ids=["seen in the run", "seen at the end"])
def test_disk_that_hangs_delays_no_handler_on_the_wall_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_most: int
) -> None:
    file = tmp_path / "x.jsonl"
    monkeypatch.setattr(page_recorder, "MAX_UNWRITTEN_BYTES", at_most)
    monkeypatch.setattr(page_recorder, "CLOSE_TIMEOUT_S", 0.1)
    for name in ("is_asked", "may_answer"):
        monkeypatch.setattr(HangingDisk, name, threading.Event())
    numbers = iter(range(5))

    def send(loop: Any) -> None:
        number = next(numbers, None)
        if (
            number == 0
        ):  # the thread hangs at the line of the start before there is a page, however busy the computer is
            assert HangingDisk.is_asked.wait(20.0)
        loop.schedule(tasks.terminate("done") if number is None else loop.store_data_task("x", number))

    config = Config(factories={"test": [RecorderEndpointFactory(file, "x"), FunctionLoopFactory(send, rate_hz=100)]})
    node = Node("test", config)
    with monkeypatch.context() as context:
        context.setattr(Path, "open", lambda path, mode, buffering: HangingDisk(path, mode))
        begun_s = time.monotonic()
        node.loop()
    assert time.monotonic() - begun_s < 5.0
    assert node.get_data("x") == 4
    assert len(node.notes) == 1
    assert "the disk is too slow, or does not answer" in node.notes[0]
    (thread,) = (one for one in threading.enumerate() if one.name == "page-recorder")
    HangingDisk.may_answer.set()
    thread.join(10.0)
    assert not thread.is_alive()


@pytest.mark.slow
def test_on_the_wall_clock_every_page_is_in_the_file_at_the_end(tmp_path: Path) -> None:
    file = tmp_path / "x.jsonl"
    numbers = iter(range(100))

    def send(loop: Any) -> None:
        number = next(numbers, None)
        loop.schedule(tasks.finish("done") if number is None else loop.store_data_task("x", number))

    config = Config(factories={"test": [RecorderEndpointFactory(file, "x"), FunctionLoopFactory(send, rate_hz=1000)]})
    Node("test", config).loop()
    assert [page.data for page in PageReader(file)] == list(range(100))


def test_a_replay_writes_nothing(tmp_path: Path) -> None:
    file = tmp_path / "x.jsonl"
    record(file, [1])
    before = file.read_bytes()
    config = Config(factories={"test": [RecorderEndpointFactory(file, "x")]})
    node = Node("test", config, clock=SimClock(), is_replay=True)
    node.schedule(node.store_data_task("x", 2))
    node.loop()
    assert node.get_data("x") == 2
    assert file.read_bytes() == before


def test_two_nodes_may_record_into_one_file(tmp_path: Path) -> None:
    file = tmp_path / "x.jsonl"
    clock = SimClock()
    nodes = [
        Node(
            role,
            Config(factories={role: [RecorderEndpointFactory(file, "x"), ListReplayerFactory([1, 2], "x")]}),
            clock=clock,
        )
        for role in "ab"
    ]
    LockStep(nodes, clock).run()
    assert sorted((page.origin, page.data) for page in PageReader(file)) == [
        ("a_node", 1),
        ("a_node", 2),
        ("b_node", 1),
        ("b_node", 2),
    ]


@pytest.mark.parametrize(("keys", "expected"), [(3, "are 3"), (["depth", 3], "hold 3, which is not a key")])
def test_invalid_keys_raise_config_error(keys: Any, expected: str) -> None:
    with pytest.raises(ConfigError, match=f"RecorderEndpointFactory's keys {expected}"):
        RecorderEndpointFactory("f", keys)
