"""Replayers store every item once, in order and on time, and all are handled before they end the run."""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import (
    Config,
    ListReplayerFactory,
    Node,
    Page,
    RecorderEndpointFactory,
    ReplayerLoopFactory,
    SimClock,
    SNRTestCase,
    Task,
    TaskType,
    TextReplayerFactory,
    TimeoutLoopFactory,
    WallClock,
)
from snr_sim.prelude.errors import ComponentFailedError, ConfigError
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import PageRecord
from snr_sim.testing.function_components import FunctionEndpoint, FunctionEndpointFactory, FunctionLoopFactory


class CollectorFactory(FunctionEndpointFactory):
    def __init__(self, into: list[Any]) -> None:
        super().__init__(name="collector")
        self.into = into

    def get(self, parent: Node) -> FunctionEndpoint:
        part = super().get(parent)
        part.task_handlers = {(TaskType.store_page, "x"): self.collect}
        return part

    def collect(self, task: Task, task_id: Any) -> None:
        self.into.append((task.val_list[0].created_at_s, task.val_list[0].data))


@pytest.mark.slow
@pytest.mark.parametrize("clock", [SimClock, WallClock])
@pytest.mark.parametrize("values", [[], [1.5], list(range(10))])
def test_all_values_are_handled_in_order_before_the_end(values: list[Any], clock: type) -> None:
    into: list[Any] = []
    replayer = ListReplayerFactory(values, "x", exit_when_done=True, rate_hz=500)
    node = Node("r", Config(factories={"r": [CollectorFactory(into), replayer]}), clock=clock())
    node.loop()
    assert [value for _, value in into] == values
    assert node.exit_reason == "replayed"


def test_a_value_comes_at_each_tick_and_then_no_more() -> None:
    into: list[Any] = []
    factories = [CollectorFactory(into), ListReplayerFactory("abc", "x", rate_hz=10), TimeoutLoopFactory(seconds=5)]
    node = Node("r", Config(factories={"r": factories}), clock=SimClock())
    node.loop()
    assert into == [(0.0, "a"), (0.1, "b"), (0.2, "c")]
    assert node.exit_reason == "timeout"


def test_default_rate_equals_thread_loop_of_2021() -> None:
    into: list[Any] = []
    factories = [CollectorFactory(into), ListReplayerFactory("abcd", "x"), TimeoutLoopFactory(ms=15)]
    Node("r", Config(factories={"r": factories}), clock=SimClock()).loop()
    assert into == [(0.0, "a"), (0.001, "b"), (0.002, "c"), (0.003, "d")]


def test_a_generator_is_read_once_and_one_factory_can_serve_two_nodes() -> None:
    factory = ListReplayerFactory((x * x for x in range(3)), "x")
    for _ in range(2):
        into: list[Any] = []
        Node("r", Config(factories={"r": [CollectorFactory(into), factory]}), clock=SimClock()).loop()
        assert [value for _, value in into] == [0, 1, 4]


@pytest.mark.slow
@pytest.mark.parametrize("clock", [SimClock, WallClock])
def test_run_end_waits_for_slow_handler(clock: type) -> None:
    """Ten handlers of 0.05 s take longer than the time limit that a terminating node has for queued tasks."""
    done: list[Any] = []

    def slow(task: Task, task_id: Any) -> None:
        time.sleep(0.05)
        done.append(task.name)

    factories = [
        FunctionEndpointFactory({(TaskType.process_data, "x"): slow}),
        ListReplayerFactory(range(10), "x", exit_when_done=True, rate_hz=1000),
    ]
    Node("r", Config(factories={"r": factories}), clock=clock()).loop()
    assert len(done) == 10


# A recording again


def write_pages(file: Path, *times_s: float, key: str = "x") -> list[Page]:
    pages = [Page(key, i, "pool_node", time_s) for i, time_s in enumerate(times_s)]
    file.write_bytes(b"".join(page.serialize() + b"\n" for page in pages))
    return pages


def replayed(factories: list[Any], clock: Any) -> tuple[Node, list[tuple[float, Page]]]:
    came: list[tuple[float, Page]] = []
    node = Node("r", Config(factories={"r": [*factories, FunctionEndpointFactory(name="listener")]}), clock=clock)
    listener = node.components["listener"]
    listener.task_handlers = {TaskType.store_page: lambda task, _: came.append((node.get_time_s(), task.val_list[0]))}
    node.loop()
    return node, came


def test_pages_are_replayed_at_storage_times_with_origin_and_stamp(tmp_path: Path) -> None:
    times_s = [0.0, 0.1, 0.1, 0.1 + 0.2, 1.0 / 3.0, 7.000000001, 1e6]
    pages = write_pages(tmp_path / "x", *times_s)
    node, came = replayed([ReplayerLoopFactory(tmp_path / "x", exit=True)], SimClock())
    assert came == list(zip(times_s, pages, strict=True))
    assert (node.exit_reason, node.notes) == ("replayed", [])


@given(st.lists(st.floats(0.0, 1e4), max_size=30))
def test_the_order_of_the_file_is_kept_whatever_the_stamps_say(times_s: list[float]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        pages = write_pages(Path(folder) / "x", *times_s)
        _, came = replayed([ReplayerLoopFactory(Path(folder) / "x")], SimClock())
    assert [page for _, page in came] == pages
    latest = 0.0
    for (time_s, _), stamp_s in zip(came, times_s, strict=True):
        latest = max(latest, stamp_s)
        assert time_s == latest


@pytest.mark.slow
def test_on_the_wall_clock_pages_come_soon_after_their_time_and_all_before_the_end(tmp_path: Path) -> None:
    times_s = [0.0, 0.02, 0.02, 0.05, 0.08]
    pages = write_pages(tmp_path / "x", *times_s)
    node, came = replayed([ReplayerLoopFactory(tmp_path / "x", exit=True)], WallClock())
    assert [page for _, page in came] == pages
    assert all(time_s >= stamp_s for (time_s, _), stamp_s in zip(came, times_s, strict=True))
    assert node.exit_reason == "replayed"


def test_recording_of_a_replay_equals_original(tmp_path: Path) -> None:
    ticks = FunctionLoopFactory(lambda loop: loop.store_data("x", loop.get_time_s() ** 0.5), rate_hz=7)
    SNRTestCase().run_test_node([RecorderEndpointFactory(tmp_path / "one", "x"), ticks], until_s=3)
    again = [ReplayerLoopFactory(tmp_path / "one", exit=True), RecorderEndpointFactory(tmp_path / "two", "x")]
    SNRTestCase().run_test_node(again)
    assert (tmp_path / "two").read_bytes() == (tmp_path / "one").read_bytes()


def test_the_sensor_pages_of_a_trace_drive_another_controller(record_scenario: Callable[..., Trace]) -> None:
    """The radar of a recorded run is the input of a node that only reads."""
    trace = record_scenario("lander_low_gate")
    _, came = replayed([ReplayerLoopFactory(trace.path, exit=True, keys=["radar"])], SimClock())
    stored = [record for record in trace.records if isinstance(record, PageRecord) and record.name == "radar"]
    assert [(time_s, page.serialize()) for time_s, page in came] == [(one.t, bytes(one.values)[1:-1]) for one in stored]
    assert len(came) > 50


def test_damaged_lines_are_skipped_and_noted(tmp_path: Path) -> None:
    file = tmp_path / "x"
    write_pages(file, 0.0, 0.1, 0.2)
    lines = file.read_bytes().splitlines()
    file.write_bytes(b"\n".join([lines[0], b"", lines[1][:30], lines[2], lines[1][:40]]))
    node, came = replayed([ReplayerLoopFactory(file, exit=True)], SimClock())
    assert [page.data for _, page in came] == [0, 2]
    assert [note for note in node.notes if "was left out" in note] == node.notes
    assert len(node.notes) == 3


def test_replayer_without_pages_is_noted_and_may_end_run(tmp_path: Path) -> None:
    write_pages(tmp_path / "x", 0.0)
    node, came = replayed([ReplayerLoopFactory(tmp_path / "x", exit=True, keys=["depth"])], SimClock())
    assert came == []
    assert node.exit_reason == "replayed"
    assert any("found none of the pages" in note for note in node.notes)


def test_missing_recording_ends_run_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(ComponentFailedError, match=r"none\.jsonl cannot be read"):
        replayed([ReplayerLoopFactory(tmp_path / "none.jsonl")], SimClock())


@pytest.mark.slow
@pytest.mark.parametrize("far_s", [3600.0, 1e300])
def test_stop_does_not_wait_for_distant_page(tmp_path: Path, far_s: float) -> None:
    write_pages(tmp_path / "x", 0.0, far_s)
    start_s = time.monotonic()
    replayed([ReplayerLoopFactory(tmp_path / "x", exit=True), TimeoutLoopFactory(ms=50)], WallClock())
    assert time.monotonic() - start_s < 5.0


# A text


def test_a_line_comes_at_each_tick_and_the_run_ends_after_the_last(tmp_path: Path) -> None:
    (tmp_path / "moves").write_text("forward\nleft\n\nstop")
    node, came = replayed([TextReplayerFactory(tmp_path / "moves", "move", exit=True, rate_hz=4)], SimClock())
    assert [(time_s, page.data) for time_s, page in came] == [
        (0.0, "forward"),
        (0.25, "left"),
        (0.5, ""),
        (0.75, "stop"),
    ]
    assert node.exit_reason == "replayed"


@pytest.mark.slow
@pytest.mark.parametrize("clock", [SimClock, WallClock])
def test_line_waits_for_answer_to_previous_line(tmp_path: Path, clock: type) -> None:
    """The answer takes three ticks; not even the end comes before the last one."""
    (tmp_path / "moves").write_text("a\nb\nc")
    waiting: list[str] = []
    log: list[str] = []

    def on_move(task: Task, task_id: Any) -> None:
        log.append("?" + task.val_list[0].data)
        waiting.extend([task.val_list[0].data] * 3)

    def answer(loop: Any) -> None:
        if waiting and len(waiting.copy()) == 1:
            log.append("!" + waiting[0])
            loop.store_data("done", waiting[0])
        if waiting:
            waiting.pop()

    factories = [
        FunctionEndpointFactory({(TaskType.store_page, "move"): on_move}),
        FunctionLoopFactory(answer, rate_hz=500),
        TextReplayerFactory(tmp_path / "moves", "move", exit=True, rate_hz=500, wait_for="done"),
    ]
    node, _ = replayed(factories, clock())
    assert log == ["?a", "!a", "?b", "!b", "?c", "!c"]
    assert node.get_data("done") == "c"
    assert node.notes == []


def test_list_replayer_rejects_swapped_arguments() -> None:
    with pytest.raises(ConfigError, match="the values first, then their key"):
        ListReplayerFactory("depth", [1, 2])  # type: ignore[arg-type]
