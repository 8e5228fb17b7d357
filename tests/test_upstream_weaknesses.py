"""The thirty things that the 2021 library got wrong when it was run, and where the tests stand that show ours does not.

A test named `test_weakness_<number>_...` shows one by its name, wherever it stands; each has at least one. The second
table names further tests that show one under a name of their own.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from snr_sim import (
    Config,
    Expector,
    ListReplayerFactory,
    Node,
    OrderedExpector,
    Page,
    PageReader,
    RecorderEndpointFactory,
    ReplayerLoopFactory,
    SimClock,
    Task,
    TaskType,
    TextReplayerFactory,
    WallClock,
    tasks,
)
from snr_sim.core.endpoint import EndpointFactory
from snr_sim.core.loop import LoopFactory
from snr_sim.core.runners import CliRunner
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

TESTS = Path(__file__).parent

WEAKNESSES = {
    1: "Ctrl-C can hang a node for good",
    2: "a stack instead of a queue: a task that asks for itself starves all others",
    3: "a stack instead of a queue: the order is reversed",
    4: "the last data are lost at the end",
    5: "an idle node burns a core, and loops are late",
    6: "a TCP stream breaks under load",
    7: "a large page never arrives",
    8: "a round trip on loopback takes 100 ms",
    9: "a two-way SocketsPair cannot start",
    10: "a remote crash without credentials",
    11: "no authentication, and it listens everywhere",
    12: "reload all bricks the node",
    13: "a second client breaks the first",
    14: "an echo storm between two nodes that share a key",
    15: "2 GiB of memory for a header of 4 bytes",
    16: "overload: an unbounded queue of old data, without a word",
    17: "the end waits for one sleep after the other",
    18: "a reload of the recorder truncates its file",
    19: "data that is not JSON kills the node that records",
    20: "what is logged is not to be seen",
    21: "MultiProcRunner does not start, spins, hides failures",
    22: "SIGTERM leaves the motors on",
    23: "two tasks cannot be compared",
    24: "default values shared between objects",
    25: "time moves when the computer's clock is set",
    26: "a loop's rate drifts with its work",
    27: "the profiler forgets, and leaves loops out",
    28: "an expector masks the error that matters",
    29: "looking for handlers costs more with every component",
    30: "the text replayer never throttles",
}

FURTHER = {
    2: [
        "core/test_machine.py::test_terminate_from_other_thread_ends_busy_node",
    ],
    4: [
        "core/test_machine.py::test_pages_stored_just_before_the_end_are_still_processed",
        "recording/test_replayers.py::test_run_end_waits_for_slow_handler",
    ],
    17: [
        "core/test_threads.py::test_a_timeout_does_not_hold_up_the_end",
    ],
    18: ["recording/test_page_recorder.py::test_second_start_continues_same_file"],
    19: ["recording/test_page_recorder.py::test_unrecordable_page_is_reported_once_and_others_are_recorded"],
    20: ["core/test_runners.py::test_with_d_the_command_line_shows_all_that_is_logged_and_the_profile"],
    23: ["prelude/test_task.py::test_tasks_with_the_same_contents_are_equal_and_have_one_hash"],
    24: ["prelude/test_task.py::test_each_task_has_a_list_of_its_own"],
    25: ["core/test_threads.py::test_setting_the_computers_clock_does_not_move_node_time"],
    27: [
        "core/test_profiler.py::test_debug_mode_times_each_handler_and_loop",
    ],
    28: [
        "testing/test_expector.py::test_exception_in_with_block_is_raised_unchanged",
        "testing/test_expector.py::test_failed_run_is_not_masked_by_missing_tasks",
    ],
    30: ["recording/test_replayers.py::test_line_waits_for_answer_to_previous_line"],
}


def all_tests() -> set[str]:
    """Every test there is, as `core/test_node.py::test_name`."""
    found = set()
    for path in TESTS.rglob("test_*.py"):
        names = re.findall(r"^ *def (test_\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)
        found |= {f"{path.relative_to(TESTS).as_posix()}::{name}" for name in names}
    return found


def test_every_weakness_of_2021_has_a_test() -> None:
    there = all_tests()
    gone = {test for tests in FURTHER.values() for test in tests} - there
    assert gone == set()
    named = {int(number[1]) for test in there if (number := re.search(r"::test_weakness_(\d+)_", test))}
    assert named == set(WEAKNESSES)


def run(*factories: Any, clock: Any = None) -> Node:
    node = Node("r", Config(factories={"r": list(factories)}), clock=clock or SimClock())
    node.loop()
    return node


@pytest.mark.slow
@pytest.mark.parametrize("clock", [SimClock, WallClock])
def test_weakness_4_all_of_ten_pages_due_at_once_are_processed_before_exit(tmp_path: Path, clock: type) -> None:
    file, done = tmp_path / "x", list[Any]()
    file.write_bytes(b"".join(Page("x", i, "pool_node", 0.0).serialize() + b"\n" for i in range(10)))
    part = FunctionEndpointFactory()
    part.handlers = {(TaskType.process_data, "x"): lambda task, task_id: done.append(task)}
    run(part, ReplayerLoopFactory(file, exit=True), clock=clock())
    assert len(done) == 10


def test_weakness_18_recorder_reload_continues_same_file(tmp_path: Path) -> None:
    file = tmp_path / "x"
    reload_between = FunctionLoopFactory(lambda loop: loop.schedule(tasks.reload_component("recorder")), rate_hz=12.5)
    values = ListReplayerFactory([1, 2, 3], "x", exit_when_done=True, rate_hz=10)
    node = run(RecorderEndpointFactory(file, "x"), values, reload_between)
    assert [page.data for page in PageReader(file)] == [1, 2, 3]
    assert file.read_text().count('"start"') == 1
    assert node.get_data("reload")["ok"] is True
    assert node.notes == []


def test_weakness_19_unknown_object_loses_its_page_only(tmp_path: Path) -> None:
    file = tmp_path / "x"
    values = [object(), np.int64(7), np.array([1, 2])]
    node = run(RecorderEndpointFactory(file, "x"), ListReplayerFactory(values, "x", exit_when_done=True))
    assert node.exit_reason == "replayed"
    pages = list(PageReader(file))
    assert [page.data.tolist() for page in pages] == [7, [1, 2]]
    assert pages[1].data.dtype == np.int64


@pytest.mark.parametrize("level", ["debug", "info", "warning", "error"])
def test_weakness_20_component_log_is_printed_with_d_at_every_level(
    level: str, capsys: pytest.CaptureFixture[str]
) -> None:
    part = FunctionEndpointFactory(
        begin=lambda it: [getattr(it.log, level)("depth?"), it.schedule(tasks.terminate("done"))]
    )
    CliRunner({"r": [part]}, ["robot.py", "-d", "r"]).run()
    assert f"{level.upper()} snr.r_node.part: depth?" in capsys.readouterr().err


def test_weakness_23_tasks_can_be_compared_and_kept_in_a_set() -> None:
    assert tasks.event("a", [1]) == tasks.event("a", [1])
    assert tasks.event("a", [1]) != tasks.event("a", [2])
    assert len({tasks.event("a"), tasks.event("a"), tasks.event("b")}) == 2


def test_weakness_24_no_two_objects_share_what_they_were_given_by_default() -> None:
    tasks.event("a").val_list.append(1)
    Task(TaskType.event, "a").val_list.append(1)
    assert (tasks.event("b").val_list, Task(TaskType.event, "b").val_list) == ([], [])
    for factory in (EndpointFactory, LoopFactory):
        factory().reload_targets.append(logging)
        assert factory().reload_targets == []
    roles: dict[str, Any] = {"r": [FunctionEndpointFactory()]}
    Config(factories=roles).factories["r"].append(FunctionEndpointFactory())
    assert len(Config(factories=roles).get("r")) == 1


def test_weakness_25_time_is_monotonic_and_one_for_all_nodes_of_a_simulation(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = WallClock()
    first_s = clock.now_s()
    monkeypatch.setattr("time.time", lambda: 0.0)  # set back by half a century
    assert clock.now_s() >= first_s >= 0.0
    stamps: list[float] = []
    common = SimClock()
    common.call_at(2.5, lambda: None)
    common.run_next()
    for role in ("topside", "urov"):
        node = Node(role, Config(factories={role: [FunctionEndpointFactory()]}), clock=common)
        stamps.append(node.page("x", 1).created_at_s)
    assert stamps == [2.5, 2.5]


def test_weakness_28_task_after_expected_order_is_reported() -> None:
    with pytest.raises(KeyError, match="what matters"), Expector({TaskType.event: 1}):
        raise KeyError("what matters")
    expector = OrderedExpector([(TaskType.event, "a")])
    for _ in range(2):
        expector.on_task(tasks.event("a"))
    assert "nothing more" in expector.failures()[0]


def test_weakness_30_a_text_comes_line_by_line_at_its_rate(tmp_path: Path) -> None:
    file, times = tmp_path / "moves", list[float]()
    file.write_text("\n".join("abc"))
    listener = FunctionEndpointFactory()
    listener.handlers = {(TaskType.store_page, "move"): lambda task, _: times.append(task.val_list[0].created_at_s)}
    run(listener, TextReplayerFactory(file, "move", exit=True, rate_hz=2))
    assert times == [0.0, 0.5, 1.0]
