"""The trace on disk: only whole lines, at most the last moments lost, and a clear error about damage."""

import json
import math
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim import Config, Node, SimClock, SimRunner, TaskType, tasks
from snr_sim.links.memory import MemoryLink
from snr_sim.prelude.errors import TraceError
from snr_sim.prelude.task import KINDS
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import (
    EndRecord,
    ErrorRecord,
    Executed,
    InputRecord,
    PageRecord,
    Record,
    TaskRecord,
    decode_line,
    encode_record,
)
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header, record_program
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

VALUES: list[Any] = [
    0.1 + 0.2, -0.0, math.nan, math.inf, -math.inf, 2**70, "Grüße\n", None, True, b"\x00\xff", (1, 2.5),
    {"a": [1.0, math.nan]}, {3: "three"}, np.array([0.1, math.nan]), np.eye(3, dtype=np.float32), np.zeros(300),
    np.int16(-3),
]  # fmt: skip
ENDER = {(TaskType.process_data, "last"): lambda task, task_id: tasks.terminate("done")}


def stores(values: list[Any]) -> FunctionEndpointFactory:
    def begin(part: Any) -> None:
        for i, value in enumerate(values):
            part.store_data(f"value{i}", value)
        part.store_data("last", True)

    return FunctionEndpointFactory(ENDER, begin=begin)


def record(tmp_path: Path, *factories: Any, roles: dict[str, list[Any]] | None = None, links: Any = ()) -> Trace:
    config = Config(factories=roles or {"r": list(factories)})
    clock = SimClock()
    path = tmp_path / FILE_NAME
    header = program_header(list(config.factories), config, __file__, clock)
    writer = TraceWriter(path, header)
    try:
        SimRunner(config, clock=clock, recorder=writer, links=links, until_s=5.0).run()
    finally:
        writer.close()
    trace = read_trace(path)
    assert trace.digest == writer.digest
    return trace


def executed(trace: Trace) -> list[Executed]:
    return [one for one in trace.records if isinstance(one, (TaskRecord, PageRecord))]


# What is written comes back


def test_every_line_encodes_to_the_same_bytes(record_scenario: Callable[..., Trace]) -> None:
    trace = record_scenario("lander_pad")
    lines = trace.path.read_bytes().splitlines()
    read = (trace.trace_info, trace.header, *map(decode_line, lines[2:]))
    assert [encode_record(line) for line in read] == lines


def test_page_sent_over_link_is_stored_once(tmp_path: Path) -> None:
    def roles() -> dict[str, list[Any]]:
        top = FunctionLoopFactory(lambda loop: loop.store_data("joystick", {"x": loop.rng.random()}), "joystick", 20.0)
        return {"top": [top], "rov": [echo("joystick", "thrust")]}

    links = [MemoryLink(["joystick"], "top", "rov", latency_s=0.013), MemoryLink(["thrust"], "rov", "top")]
    trace = record(tmp_path, roles=roles(), links=links)
    data = trace.path.read_bytes()
    stored = [one for one in executed(trace) if isinstance(one, PageRecord) and one.name in ("joystick", "thrust")]
    values = [bytes(one.values) for one in stored]
    assert len(values) > 300  # of each page two: at the node that made it, and at the other one
    assert all(data.count(page) == 1 for page in set(values))
    assert len(set(values)) < 0.51 * len(values)
    assert data.count(b'"kind":"repeat"') == sum(one.source.startswith("link_") for one in inputs(trace))
    for role in ("top", "rov"):
        assert replay_node(trace, role, Config(factories=roles())).is_identical


def test_process_data_refers_to_its_page_and_replays_after_newer_pages(tmp_path: Path) -> None:
    def burst() -> list[Any]:
        made: list[Any] = []

        def on_x(task: Any, task_id: Any) -> Any:
            seen = [task.page.data, made[-1].get_data("x"), made[-1].get_data("x_prev")]
            return made[-1].store_data_task("seen", {"seen": seen}, process=False)

        ticker = FunctionLoopFactory(
            lambda loop: [loop.store_data("x", {"of": loop.rng.random()}) for _ in range(5)], "x", 2.0
        )
        return [ticker, FunctionEndpointFactory({(TaskType.process_data, "x"): on_x}, begin=made.append)]

    trace = record(tmp_path, *burst())
    stored = [one for one in executed(trace) if one.type == "store_page" and one.name == "x"]
    processed = [one for one in executed(trace) if one.type == "process_data"]
    data = trace.path.read_bytes()
    assert len(stored) == len(processed) >= 50
    for one, task in zip(stored, processed, strict=True):
        assert bytes(task.values) == bytes(one.values)
        assert data.count(bytes(one.values)) == 1
    pages = [decode_value(bytes(one.values), KINDS)[0].data for one in processed]
    answers = [one.handled[0].returned[0] for one in processed]
    seen = [decode_value(bytes(one.values), KINDS)[0].data["seen"] for one in answers]
    assert seen == [[page, page, before] for page, before in zip(pages, [None, *pages], strict=False)]
    replay = replay_node(trace, "r", Config(factories={"r": burst()}))
    assert replay.is_identical, replay.divergences[0]
    assert [one for one in replay.records if isinstance(one, TaskRecord)] == processed


def test_late_page_is_stored_again(tmp_path: Path) -> None:
    busy = FunctionLoopFactory(lambda loop: loop.store_data("x", loop.get_time_s()), "x", 1000.0)
    slow = FunctionLoopFactory(lambda loop: loop.store_data("y", loop.get_time_s()), "y", 1.0)
    link = MemoryLink(["y"], "one", "two", latency_s=0.5)
    trace = record(tmp_path, roles={"one": [busy, slow], "two": []}, links=[link])
    assert sum(one.source == "link_one" for one in inputs(trace)) >= 4
    assert b'"kind":"repeat"' not in trace.path.read_bytes()


def inputs(trace: Trace) -> list[InputRecord]:
    return [one for one in trace.records if isinstance(one, InputRecord)]


def test_page_values_round_trip_to_the_bit(tmp_path: Path) -> None:
    trace = record(tmp_path, stores(VALUES))
    pages = [decode_value(bytes(one.values), KINDS)[0] for one in trace.records if isinstance(one, PageRecord)]
    for value, page in zip(VALUES, pages, strict=False):
        assert type(page.data) is type(value)
        np.testing.assert_equal(page.data, value)
        assert getattr(page.data, "dtype", None) == getattr(value, "dtype", None)
    assert replay_node(trace, "r", Config(factories={"r": [stores(VALUES)]})).is_identical


@pytest.mark.parametrize(
    ("scenario", "controller"),
    [
        *(("lander_vertical", name) for name in ("coast", "hover_and_drop", "quadratic", "optimal")),
        ("lander_low_gate", "optimal"),
        ("lander_pad", "pad"),
        ("lander_rough", "pad"),
    ],
)
def test_every_executed_task_is_recorded(record_scenario: Callable[..., Trace], scenario: str, controller: str) -> None:
    trace = record_scenario(scenario, controller)  # counts them, too
    end = trace.records[-1]
    assert isinstance(end, EndRecord)
    assert end.summary["tasks"] == len(executed(trace))
    assert end.summary["pages"] == sum(isinstance(one, PageRecord) for one in trace.records)
    assert trace.is_ended
    assert not trace.is_truncated


def test_unencodable_value_leaves_readable_trace(tmp_path: Path) -> None:
    endless: list[Any] = []
    endless.append(endless)
    trace = record(tmp_path, stores([endless, 1.0]))
    page = next(one for one in trace.records if isinstance(one, PageRecord))
    assert b"contains itself" in bytes(page.values)
    assert replay_node(trace, "r", Config(factories={"r": [stores([endless, 1.0])]})).is_identical


def test_cause_of_task_is_an_earlier_record_with_that_task(record_scenario: Callable[..., Trace]) -> None:
    by_seq = {one.seq: one for one in record_scenario("lander_pad").records}
    for one in executed(record_scenario("lander_pad")):
        cause: Any = by_seq[one.cause]
        assert cause.seq < one.seq
        if isinstance(cause, InputRecord):
            assert (cause.type, cause.name, one.index) == (one.type, one.name, 0)
        else:
            given = [task for by in getattr(cause, "handled", [cause]) for task in by.returned]
            assert (given[one.index].type, given[one.index].name) == (one.type, one.name)


# The digest


def test_digest_excludes_time_and_folder(record_scenario: Callable[..., Trace], tmp_path: Path) -> None:
    trace = record_scenario()
    lines = trace.path.read_bytes().splitlines(keepends=True)
    elsewhere = msgspec.structs.replace(trace.trace_info, started="never", scenario="/else/lander_vertical.py")
    path = tmp_path / FILE_NAME
    path.write_bytes(b"".join([encode_record(elsewhere) + b"\n", *lines[1:]]))
    assert read_trace(path).digest == trace.digest
    seeded = msgspec.structs.replace(trace.header, seed=1)
    path.write_bytes(b"".join([lines[0], encode_record(seeded) + b"\n", *lines[2:]]))
    assert read_trace(path).digest != trace.digest


def test_digest_depends_on_every_other_byte(record_scenario: Callable[..., Trace], tmp_path: Path) -> None:
    trace = record_scenario()
    data = trace.path.read_bytes()
    path = tmp_path / FILE_NAME
    path.write_bytes(data.replace(b'"seq":9,"t":', b'"seq":9,"t":1', 1))
    assert read_trace(path).digest != trace.digest


# Damaged and foreign files


def test_truncated_trace_reads_up_to_last_whole_record(tmp_path: Path) -> None:
    whole = record(tmp_path, stores(VALUES))
    data = whole.path.read_bytes()
    start = len(b"".join(data.splitlines(keepends=True)[:-3]))
    head = whole.records[:-3]
    assert len(data) - start > 200
    for length in range(start, len(data) + 1):
        path = tmp_path / f"{length}.jsonl"  # writing over a file may wait for the disk
        path.write_bytes(data[:length])
        trace = read_trace(path)
        assert len(trace.records) == len(head) + data[start:length].count(b"\n")
        assert trace.is_truncated == (data[:length][-1:] != b"\n")


def test_truncated_header_raises(record_scenario: Callable[..., Trace], tmp_path: Path) -> None:
    first, second = record_scenario().path.read_bytes().splitlines(keepends=True)[:2]
    for length in range(0, len(first + second), 97):
        path = tmp_path / f"{length}.jsonl"  # writing over a file may wait for the disk
        path.write_bytes((first + second)[:length])
        with pytest.raises(TraceError, match="no whole line" if length < len(first) else "no whole header"):
            read_trace(path)


def swap(lines: list[bytes]) -> None:
    lines[6], lines[7] = lines[7], lines[6]


def replace(line: int, old: bytes, new: bytes) -> Callable[[list[bytes]], None]:
    """Return an edit of the first place in a line that matches a pattern."""

    def edit(lines: list[bytes]) -> None:
        lines[line], count = re.subn(old, new, lines[line], count=1)
        assert count

    return edit


def unlist(lines: list[bytes]) -> None:
    place = next(i for i, line in enumerate(lines) if b'"kind":"input"' in line)
    replace(place, rb'"values":\[.*\]', b'"values":"[]"')(lines)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (swap, "record 5 has seq 6; a line was taken out, put in or moved"),
        (lambda lines: lines.pop(6), "record 5 has seq 6"),
        (lambda lines: lines.insert(6, lines[6]), "record 6 has seq 5"),
        (lambda lines: lines.insert(6, b"\n"), "line 7 is not a record"),
        (lambda lines: lines.insert(6, b"Hello\n"), "line 7 is not a record"),
        (replace(6, b'"kind"', b'"kjnd"'), "line 7 is not a record"),
        (replace(6, b'"kind":"', b'"kind":"\xff'), "line 7 is not a record"),
        (replace(6, b'"seq":5', b'"seq":"5"'), "line 7 is not a record"),
        (replace(0, b'"schema":3', b'"schema":9'), "format 9.*this kit reads format 3"),
        (replace(0, rb'"argv":\[', b'"argv":[1,'), "its first line is damaged"),
        (replace(1, b'"seed":0', b'"seed":"zero"'), "its header is damaged"),
        (replace(6, rb'"cause":\d+', b'"cause":5'), "the cause of record 5 does not come before it"),
        (replace(6, rb'"cause":\d+', b'"cause":1'), "record 5 refers to task 0 of record 1, which is not there or"),
        (unlist, r"record \d+ has values that are not a list"),
        (lambda lines: lines.pop(1), "its header is damaged"),
        (lambda lines: lines.insert(0, b'{"kind":"header","schema":1}\n'), "format 1; this kit reads format 3"),
        (lambda lines: lines.insert(0, lines[2]), "first line does not say so"),
        (lambda lines: lines.insert(0, b"[1]\n"), "first line does not say so"),
        (lambda lines: lines.insert(0, b"\x89PNG\n"), "first line does not say so"),
        (lambda lines: lines.clear(), "no whole line"),
    ],
)
def test_damaged_or_foreign_file_raises_with_line(
    record_scenario: Callable[..., Trace], tmp_path: Path, edit: Callable[[list[bytes]], Any], message: str
) -> None:
    lines = record_scenario().path.read_bytes().splitlines(keepends=True)
    edit(lines)
    path = tmp_path / FILE_NAME
    path.write_bytes(b"".join(lines))
    with pytest.raises(TraceError, match=message) as caught:
        read_trace(path)
    assert caught.value.fix or "is not a record" in message


def test_missing_trace_or_folder_raises(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="No such file"):
        read_trace(tmp_path / "gone.jsonl")
    with pytest.raises(TraceError, match="directory"):
        read_trace(tmp_path)


def test_existing_trace_is_never_overwritten(record_scenario: Callable[..., Trace]) -> None:
    before = record_scenario().path.read_bytes()
    with pytest.raises(TraceError, match="File exists"):
        TraceWriter(record_scenario().path, record_scenario().header)
    assert record_scenario().path.read_bytes() == before


def test_arrows_are_rounded_and_non_finite_numbers_accepted(
    record_scenario: Callable[..., Trace], tmp_path: Path
) -> None:
    writer = TraceWriter(tmp_path / FILE_NAME, record_scenario().header)
    chance = random.Random(0)
    fine = [0.123456, -2.00004, 1e-9, -1e-9, 0.0, -0.0, *(chance.uniform(-1e3, 1e3) for _ in range(1000))]
    vectors = {"fine": fine, "odd": [math.nan, math.inf, 1e306, 0.123456, 0.0, 1.0]}
    writer.truth(0.0, {"poses": {}, "vectors": vectors, "values": {}})
    writer.close()
    line = writer.path.read_bytes().splitlines()[2]
    assert msgspec.json.encode([round(number, 4) for number in fine]) in line
    assert b'"odd":[null,null,1e306,0.1235,0.0,1.0]' in line


# The disk


def write_truths(writer: TraceWriter, count: int) -> None:
    for i in range(count):
        writer.truth(float(i), {"poses": {}, "vectors": {}, "values": {"x": float(i)}})


def test_record_is_on_disk_after_flush_period(record_scenario: Callable[..., Trace], tmp_path: Path) -> None:
    writer = TraceWriter(tmp_path / FILE_NAME, record_scenario().header)
    write_truths(writer, 10)
    deadline_s = time.monotonic() + 60.0
    while len(read_trace(writer.path).records) < 10:
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
    writer.close()
    writer.close()  # twice is fine


def test_failing_listener_loses_no_records(
    record_scenario: Callable[..., Trace], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    class Broken:
        def add(self, record: Record) -> None:
            raise ValueError("no window")

        def flush(self) -> None:
            pass

    writer = TraceWriter(tmp_path / FILE_NAME, record_scenario().header)
    writer.add_listener(Broken())
    write_truths(writer, 10)
    writer.close()
    assert len(read_trace(writer.path).records) == 10
    assert "The live view has stopped: no window" in capsys.readouterr().err


SLOW_PROGRAM = """
import sys
from snr_sim import Config, WallClock
from snr_sim.scenario.program import record_program
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

ticks = FunctionLoopFactory(lambda loop: loop.store_data("x", loop.get_time_s()), rate_hz=500)
config = Config(factories={"r": [ticks]})
if __name__ == "__main__":
    clock = WallClock()
    print(clock.now_s() - __import__("time").monotonic(), flush=True)
    record_program("r", config, __file__, sys.argv[1], clock=clock)
"""


@pytest.mark.wall_clock
def test_sigkill_loses_at_most_a_tenth_of_a_second(tmp_path: Path) -> None:
    """Of six that are killed one at least: a busy computer keeps threads waiting, but not always."""
    program = tmp_path / "slow.py"
    program.write_text(SLOW_PROGRAM)
    lost_s: list[float] = []
    while not lost_s or (lost_s[-1] >= 0.1 and len(lost_s) < 6):
        runs = tmp_path / f"runs{len(lost_s)}"
        child = subprocess.Popen([sys.executable, program, runs], stdout=subprocess.PIPE, text=True)
        assert child.stdout is not None
        offset_s = float(child.stdout.readline())
        deadline_s = time.monotonic() + 60.0
        while not any(len(file.read_bytes()) > 20_000 for file in runs.glob(f"*/{FILE_NAME}")):
            assert time.monotonic() < deadline_s
            time.sleep(0.02)
        killed_s = time.monotonic() + offset_s
        child.send_signal(signal.SIGKILL)
        child.wait()
        child.stdout.close()
        (path,) = runs.glob(f"*/{FILE_NAME}")
        trace = read_trace(path)
        assert not trace.is_ended
        assert [one.seq for one in trace.records] == list(range(1, len(trace.records) + 1))
        lost_s.append(killed_s - trace.records[-1].t)
    assert lost_s[0] < 0.1 + 0.1
    assert min(lost_s) < 0.1


# Several nodes, and nodes on threads


def echo(key: str, answer: str) -> FunctionEndpointFactory:
    def on_page(task: Any, task_id: Any) -> Any:
        part = made[-1]
        return part.store_data_task(answer, {"was": part.get_data(key), "chance": part.rng.random()})

    made: list[Any] = []
    return FunctionEndpointFactory({(TaskType.process_data, key): on_page}, name=f"echo_{key}", begin=made.append)


def test_linked_nodes_in_one_trace_replay_identically(tmp_path: Path) -> None:
    def roles() -> dict[str, list[Any]]:
        top = FunctionLoopFactory(lambda loop: loop.store_data("joystick", loop.get_time_s()), "joystick", 20.0)
        bottom = FunctionLoopFactory(lambda loop: loop.store_data("depth", loop.get_time_s()), "depth", 33.0)
        return {"top": [top, echo("thrust", "shown")], "rov": [bottom, echo("joystick", "thrust")]}

    links = [
        MemoryLink(["joystick"], "top", "rov", latency_s=0.013, jitter_s=0.02, loss=0.1),
        MemoryLink(["thrust", "depth"], "rov", "top", latency_s=0.0),
    ]
    trace = record(tmp_path, roles=roles(), links=links)
    assert {getattr(one, "node", "") for one in executed(trace)} == {"top_node", "rov_node"}
    assert {one.source for one in trace.records if isinstance(one, InputRecord)} >= {"link_top", "link_rov"}
    for role in ("top", "rov"):
        replay = replay_node(trace, role, Config(factories=roles()))
        assert replay.is_identical, replay.divergences[0]
        assert replay.executed == replay.recorded > 100
    (tmp_path / "again").mkdir()
    assert (
        record(tmp_path / "again", roles=roles(), links=[replace_link(link) for link in links]).digest == trace.digest
    )


def replace_link(link: MemoryLink) -> MemoryLink:
    return MemoryLink(link.keys, link.from_role, link.to_role, faults=link.faults)


def test_failure_names_the_task_of_its_own_node(tmp_path: Path) -> None:
    def fail(task: Any, task_id: Any) -> None:
        raise ZeroDivisionError("depth is 0")

    busy = FunctionLoopFactory(lambda loop: loop.store_data("x", 1), "busy", 100.0)
    roles: dict[str, list[Any]] = {
        "first": [busy],
        "second": [FunctionLoopFactory(name="late", rate_hz=1.0, loop=lambda loop: loop.schedule(tasks.event("go"))),
                   FunctionEndpointFactory({(TaskType.event, "go"): fail})],
    }  # fmt: skip
    with pytest.raises(Exception, match="depth is 0"):
        record(tmp_path, roles=roles)
    trace = read_trace(tmp_path / FILE_NAME)
    (error,) = (one for one in trace.records if isinstance(one, ErrorRecord))
    cause = trace.records[error.cause - 1]
    assert isinstance(cause, TaskRecord)
    assert (cause.node, cause.name) == ("second_node", "go")
    assert replay_node(trace, "second", Config(factories=roles)).is_identical


def threaded() -> Config:
    """Loops on threads that compete, random numbers, time, and a task that schedules itself."""

    def count(task: Any, task_id: Any) -> Any:
        part = made[-1]
        part.counts = getattr(part, "counts", 0) + 1
        if part.counts == 400:
            return tasks.terminate("enough")
        more = [tasks.event("spin", [task.val_list[0] - 1])] if task.name == "spin" and task.val_list[0] else []
        seen = {"n": part.counts, "t": part.get_time_s(), "r": part.rng.random(), "a": part.get_data("a")}
        return [part.store_data_task("seen", seen, process=False), *more]

    made: list[Any] = []
    part = FunctionEndpointFactory({TaskType.process_data: count, TaskType.event: count}, begin=made.append)
    return Config(factories={"r": [
        FunctionLoopFactory(lambda loop: loop.store_data("a", [loop.get_time_s(), loop.rng.random()]), "a", 500),
        FunctionLoopFactory(lambda loop: loop.store_data("b", loop.get_time_s()), "b", 333),
        FunctionLoopFactory(lambda loop: loop.schedule(tasks.event("spin", [3])), "c", 200),
        part,
    ]})  # fmt: skip


@pytest.mark.slow
def test_threaded_node_on_wall_clock_replays_identically_each_time(tmp_path: Path) -> None:
    stop = threading.Event()
    load = threading.Thread(target=lambda: [sum(range(1000)) for _ in iter(stop.is_set, True)])
    for attempt in range(3):
        if attempt == 2:
            load.start()
        try:
            folder = record_program("r", threaded(), __file__, tmp_path)
        finally:
            stop.set() if attempt == 2 else None
        trace = read_trace(folder / FILE_NAME)
        assert trace.header.clock == "wall"
        for _ in range(3):
            replay = replay_node(trace, "r", threaded())
            assert replay.is_identical, replay.divergences[0]
            assert replay.executed == replay.recorded >= 400
    load.join()


def test_failed_component_creation_leaves_no_run_folder(tmp_path: Path) -> None:
    two = [FunctionEndpointFactory(name="same"), FunctionEndpointFactory(name="same")]
    with pytest.raises(Exception, match="two components named 'same'"):
        record_program("r", Config(factories={"r": two}), __file__, tmp_path / "runs")
    assert list(tmp_path.iterdir()) == []


def test_header_contains_names_versions_and_sources(record_scenario: Callable[..., Trace]) -> None:
    header = record_scenario("lander_pad").header
    trace_info = record_scenario("lander_pad").trace_info
    lines = record_scenario("lander_pad").path.read_bytes().split(b"\n")
    assert [json.loads(line)["kind"] for line in lines[:2]] == ["trace", "header"]
    assert (trace_info.scenario, trace_info.controller, trace_info.argv) == ("lander_pad", "pad", sys.argv)
    assert (header.scenario, header.robot, header.controller, header.roles) == (
        "lander_pad",
        "lander",
        "pad",
        ["lander"],
    )
    assert {"scenario/lander_pad.py", "robot/robot.py", "robot/parameters.py", "controller/pad.py"} <= set(
        header.sources
    )
    assert all(len(digest) == 64 for digest in header.sources.values())
    assert {"numpy", "msgspec", "pymunk"} <= set(header.packages)
    assert header.commands == {"lander_node": ["engine"]}


def test_node_executes_same_tasks_without_recorder(tmp_path: Path) -> None:
    trace = record(tmp_path, stores([1.0, 2.0]))
    node = Node("r", Config(factories={"r": [stores([1.0, 2.0])]}), clock=SimClock())
    node.loop()
    assert node.machine.executed == len(executed(trace))
