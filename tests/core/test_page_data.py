"""Content of a page: data, copied when the page is created; and the errors for anything else."""

from collections import OrderedDict, defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest

from snr_sim import Config, ListReplayerFactory, Node, SimClock, SimRunner, SomeTasks, Task, TaskType, tasks
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.prelude.task import KINDS
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import EndRecord, PageRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory


@dataclass
class Pose:
    x_m: float = 0.0
    path_m: list[float] = field(default_factory=list)


class Target(msgspec.Struct):
    path_m: list[float]


@dataclass(frozen=True)
class Frozen:
    path_m: list[float]


class Pair(NamedTuple):
    first: list[float]
    second: float


class Plan:
    """Of a student's, and no data."""

    def __init__(self, *held: Any) -> None:
        self.held = held


def ticking(store: Any) -> list[Any]:
    """A loop that sends three events; at each the part calls `store`."""

    def begin(part: Any) -> None:
        made.append(part)

    def on_tick(task: Task, task_id: Any) -> SomeTasks:
        return tasks.finish("done") if task.val_list[0] == 3 else store(made[-1], task.val_list[0])

    made: list[Any] = []
    counts: list[int] = []

    def tick(loop: Any) -> None:
        counts.append(1)
        loop.schedule(tasks.event("tick", [len(counts) - 1]))

    return [
        FunctionLoopFactory(tick, rate_hz=10.0),
        FunctionEndpointFactory({(TaskType.event, "tick"): on_tick}, "mine", begin=begin),
    ]


def recorded(tmp_path: Path, factories: list[Any]) -> tuple[Node, Trace]:
    config, clock = Config(factories={"r": factories}), SimClock()
    writer = TraceWriter(tmp_path / FILE_NAME, program_header(["r"], config, __file__, clock))
    runner = SimRunner(config, clock=clock, recorder=writer, until_s=5.0)
    try:
        runner.run()
    finally:
        writer.close()
    return runner.nodes["r"], read_trace(writer.path)


def stored(trace: Trace, key: str) -> list[Any]:
    found = [one for one in trace.records if isinstance(one, PageRecord) and one.name == key]
    return [decode_value(bytes(one.values), KINDS)[0].data for one in found]


# Later changes


def change_list(data: Any) -> None:
    data.append(1.0)


def change_dict(data: Any) -> None:
    data["path_m"].append(1.0)
    data["n"] = data.get("n", 0) + 1


def change_array(data: Any) -> None:
    data += 1.0


def change_record(data: Any) -> None:
    data.path_m.append(1.0)


CHANGED = [
    ([0.0], change_list),
    ({"path_m": [0.0]}, change_dict),
    (OrderedDict(path_m=[0.0]), change_dict),
    (({"path_m": [0.0]},), lambda data: change_dict(data[0])),
    (bytearray(b"ab"), lambda data: data.append(1)),
    (np.zeros(3), change_array),
    ({"pose": np.zeros(3)}, lambda data: change_array(data["pose"])),
    (Pose(), change_record),
    (Target([0.0]), change_record),
    (Frozen([0.0]), change_record),
    (Pair([0.0], 1.0), lambda data: data.first.append(1.0)),
]


@pytest.mark.parametrize(("data", "change"), CHANGED, ids=lambda one: type(one).__name__)
def test_page_keeps_data_when_owner_changes_it(data: Any, change: Any) -> None:
    node = Node("r", Config(factories={"r": [FunctionEndpointFactory()]}), clock=SimClock())
    part: Any = node.components["part"]
    before = repr(data)
    pages = [part.page("x", data), node.page("x", data), part.store_data_task("x", data).page]
    node.store_data("x", data)
    change(data)
    assert repr(data) != before
    assert [repr(page.data) for page in pages] == [before] * 3
    assert {type(page.data) for page in pages} == {type(data)}
    assert node.notes == []


def test_growing_list_is_kept_as_stored_in_prev_trace_and_replay(tmp_path: Path) -> None:
    def factories() -> list[Any]:
        path_m: list[float] = []
        seen: dict[str, Any] = {}

        def store(part: Any, count: int) -> SomeTasks:
            seen["before"], seen["newest"] = part.get_data("path_prev"), part.get_data("path")
            path_m.append(float(count))
            return [part.store_data_task("path", path_m), part.store_data_task("seen", seen)]

        return ticking(store)

    node, trace = recorded(tmp_path, factories())
    assert stored(trace, "path") == [[0.0], [0.0, 1.0], [0.0, 1.0, 2.0]]
    assert stored(trace, "seen")[-1] == {"before": [0.0], "newest": [0.0, 1.0]}
    assert (node.get_data("path_prev"), node.get_data("path")) == ([0.0, 1.0], [0.0, 1.0, 2.0])
    assert replay_node(trace, "r", Config(factories={"r": factories()})).is_identical


# Objects


def note_of(node: Node) -> str:
    (note,) = node.notes
    return note


def test_object_in_page_is_noted_once_with_class_and_line(tmp_path: Path) -> None:
    def store(part: Any, count: int) -> SomeTasks:
        return part.store_data_task("plan", {"next": [count, Plan(1.5)]})

    node, trace = recorded(tmp_path, ticking(store))
    first, second, third = note_of(node).splitlines()
    assert 'return part.store_data_task("plan", {"next": [count, Plan(1.5)]})' in first
    assert "test_page_data.py, line " in first
    assert second.startswith("  Page 'plan' holds an object of class Plan (data['next'][1]): it is recorded for people")
    assert third.strip().startswith("Try: store numbers, text, lists, dicts, numpy arrays, or dataclasses")
    (end,) = (one for one in trace.records if isinstance(one, EndRecord))
    assert end.summary["notes"] == node.notes
    assert trace.path.read_bytes().count(b'"fields":{"held":{"$":"tuple","v":[1.5]}}') == 3


def test_object_stored_by_library_names_no_program_line(tmp_path: Path) -> None:
    node, trace = recorded(tmp_path, [ListReplayerFactory([Plan(1.5), 2.0], "x", exit_when_done=True)])
    assert node.notes == []
    assert b'"fields":{"held":{"$":"tuple","v":[1.5]}}' in trace.path.read_bytes()


def test_a_list_that_contains_itself_is_noted_with_its_line() -> None:
    data: list[Any] = []
    data.append(data)
    node = Node("r", Config(factories={"r": []}), clock=SimClock())
    node.store_data("x", data)
    assert "Page 'x' holds an object of class list (data): it contains itself or is nested too deeply" in note_of(node)


@pytest.mark.parametrize(
    ("hold", "where"),
    [
        (lambda part: part, "data"),
        (lambda part: {"who": [part]}, "data['who'][0]"),
        (lambda part: Pose(part), "data.x_m"),
    ],
)
def test_component_in_page_raises_with_class_and_line(tmp_path: Path, hold: Any, where: str) -> None:
    def store(part: Any, count: int) -> SomeTasks:
        return part.store_data_task("me", hold(part))

    with pytest.raises(ComponentFailedError) as caught:
        recorded(tmp_path, ticking(store))
    first, second, *_, last = str(caught.value).splitlines()
    assert 'return part.store_data_task("me", hold(part))' in first
    assert (
        f"Page 'me' holds 'mine' of class FunctionEndpoint ({where}), which is a part of the program and not data."
        in second
    )
    assert last.strip().startswith("Try: store numbers, text, lists, dicts, numpy arrays")


def test_node_and_clock_in_page_raise() -> None:
    node = Node("r", Config(factories={"r": []}), clock=SimClock())
    for part in (node, node.clock, node.datastore):
        with pytest.raises(Exception, match=f"class {type(part).__name__}.*, which is a part of the program"):
            node.store_data("x", part)


def test_object_referring_to_component_is_recorded_with_component_name(tmp_path: Path) -> None:
    _, trace = recorded(tmp_path, ticking(lambda part, count: part.store_data_task("plan", Plan(part))))
    (line,) = (one for one in trace.path.read_bytes().splitlines() if b'"held"' in one and b'"seq":3,' in one)
    assert b'"type":"snr_sim.testing.function_components.FunctionEndpoint","fields":{"name":"mine"}' in line
    assert len(line) < 500


def test_named_tuple_and_dict_subclass_are_recorded_with_content(tmp_path: Path) -> None:
    odd: dict[str, float] = defaultdict(float, a=float("nan"))
    _, trace = recorded(
        tmp_path, ticking(lambda part, count: part.store_data_task("x", {"p": Pair([0.5], 1.0), "d": odd}))
    )
    data = trace.path.read_bytes()
    assert b'Pair","fields":{"first":[0.5],"second":1.0}' in data
    assert b'"d":{"a":{"$":"float","v":"nan"}}' in data
