"""Loops in processes of their own: the same loop, its pages and arrays, its failures, and its end."""

import logging
import os
import signal
import threading
import time
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pytest

from snr_sim import Config, Mode, Node, SimClock, TaskType, TimeoutLoopFactory, tasks
from snr_sim.core.process.process_executor import ProcessExecutor
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.scenario.library import load_program
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

loops: Any = load_program(str(Path(__file__).parent / "process_loops.py"))

LIMIT_S = 60.0  # for what takes a fraction of a second on a machine that has nothing else to do


def node_of(*factories: Any, mode: Mode = Mode.TEST) -> Node:
    return Node("r", Config(mode, {"r": [*factories, TimeoutLoopFactory(seconds=LIMIT_S)]}))


def run(*factories: Any) -> Node:
    node = node_of(*factories)
    node.loop()
    assert node.exit_reason != "timeout"
    return node


def backing_of(node: Node, name: str = "worker") -> ProcessExecutor:
    executor = node.components[name]._executor  # type: ignore[attr-defined]
    assert isinstance(executor, ProcessExecutor)
    return executor


def ends_at(key: str, name: str = "listener") -> FunctionEndpointFactory:
    return FunctionEndpointFactory({(TaskType.store_page, key): lambda task, task_id: tasks.terminate(key)}, name)


@pytest.mark.slow
def test_loop_runs_in_other_process_with_role_and_time_of_node() -> None:
    before_s = time.monotonic()
    node = run(loops.StepsFactory(loops.report_position))
    page = node.get_page("where")
    assert page is not None
    assert page.data["pid"] != os.getpid()
    assert page.data["role"] == "r"
    assert page.origin == "r_node"
    assert page.data["time_s"] <= page.created_at_s <= time.monotonic() - before_s


def test_process_loop_runs_on_clock_in_lock_step() -> None:
    node = Node("r", Config(Mode.TEST, {"r": [loops.StepsFactory(loops.report_position)]}), clock=SimClock())
    node.loop()
    page = node.get_page("where")
    assert page is not None
    assert page.data == {"pid": os.getpid(), "time_s": 0.0, "role": "r"}


def test_unknown_executor_raises_parameter_error() -> None:
    with pytest.raises(ComponentFailedError, match="Loop 'worker' has executor = 'proces'"):
        run(loops.StepsFactory(loops.nothing, executor="proces"))


@pytest.mark.slow
def test_counts_reach_node_from_stopped_process() -> None:
    node = node_of(loops.StepsFactory(loops.note_thread), ends_at("count"), mode=Mode.DEBUG)
    node.components["listener"].task_handlers = {  # type: ignore[misc]
        (TaskType.store_page, "count"): lambda task, task_id: (
            tasks.terminate("five") if task.val_list[0].data == 5 else None
        )
    }
    node.loop()
    assert node.exit_reason == "five"
    assert backing_of(node).ticks == 5
    assert backing_of(node).late_s >= 0.0
    assert node.profiler is not None
    assert node.profiler.timings["worker.loop"].count == 5
    assert node.components["worker"].is_terminated()  # type: ignore[attr-defined]


@pytest.mark.slow
@pytest.mark.parametrize("step", ["setup", "loop", "halt", "terminate"])
def test_exception_in_process_is_loop_failure_with_student_line(step: str) -> None:
    halted: list[str] = []
    motor = FunctionEndpointFactory(name="motor", halt=lambda part: halted.append("motor"))
    factory = loops.StepsFactory(loops.end, **({step: loops.raise_error} if step != "loop" else {}))
    factory.steps["loop"] = loops.raise_error if step == "loop" else loops.end
    with pytest.raises(ComponentFailedError) as caught:
        run(motor, factory)
    first, what, where, *_ = str(caught.value).splitlines()
    assert first.startswith("tests/core/process_loops.py, line ")
    assert first.endswith('raise ValueError("no echo")')
    assert what.strip() == "ValueError: no echo"
    assert where.strip().startswith(f"in {step}() of component 'worker' at t = ")
    assert (caught.value.node, caught.value.component) == ("r_node", "worker")
    assert halted == ["motor"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("crash", "message"),
    [
        ("exit_python", "SystemExit: 3"),
        ("exit_at_once", "ended with exit status 3"),
        ("exit_at_once", "bus voltage 9.1 V"),
        ("kill_itself", "was ended by SIGKILL"),
        ("read_nowhere", "was ended by SIGSEGV"),
        ("read_nowhere", "read_nowhere"),  # the line that Python itself prints at such a crash
    ],
)
def test_process_crash_raises_component_failed(crash: str, message: str) -> None:
    halted: list[str] = []
    motor = FunctionEndpointFactory(name="motor", halt=lambda part: halted.append("motor"))
    with pytest.raises(ComponentFailedError, match=message) as caught:
        run(motor, loops.StepsFactory(getattr(loops, crash)))
    assert caught.value.component == "worker"
    assert "worker" in str(caught.value)
    assert halted == ["motor"]


@pytest.mark.slow
def test_killed_process_is_reported_although_child_holds_connection(tmp_path: Path) -> None:
    output_file = tmp_path / "told"
    node = node_of(loops.StepsFactory(loops.start_another, str(output_file)))
    start_s = time.monotonic()
    with pytest.raises(ComponentFailedError, match="SIGKILL"):
        node.loop()
    os.kill(int(output_file.read_text()), signal.SIGKILL)
    assert time.monotonic() - start_s < 50.0  # it sleeps for 60


@pytest.mark.slow
def test_halt_and_terminate_are_called_only_in_process(tmp_path: Path) -> None:
    output_file = tmp_path / "told"
    run(loops.StepsFactory(loops.end, str(output_file), halt=loops.write_halt, terminate=loops.write_terminate))
    words = [line.split() for line in output_file.read_text().splitlines()]
    assert [word for word, _ in words] == ["halt", "terminate"]
    assert str(os.getpid()) not in {pid for _, pid in words}


@pytest.mark.wall_clock
def test_hanging_process_loop_is_halted_within_timeout(tmp_path: Path) -> None:
    output_file = tmp_path / "told"

    def is_halted() -> bool:
        """On a busy machine its process may not come to it in time, and is killed."""
        node = node_of(loops.StepsFactory(loops.hang, str(output_file), halt=loops.write_halt), ends_at("pid"))
        node.loop()
        return output_file.exists() and any(
            note.startswith("Loop 'worker' did not end within 0.5 s") for note in node.notes
        )

    assert any(is_halted() for _ in range(4))


@pytest.mark.slow
def test_unresponsive_process_is_killed_and_noted() -> None:
    node = node_of(loops.StepsFactory(loops.hang_in_c), ends_at("pid"))
    node.loop()
    assert any("did not end within 0.8 s and was killed" in note for note in node.notes)
    with pytest.raises(ProcessLookupError):
        os.kill(node.get_data("pid"), 0)  # no zombie either


@pytest.mark.wall_clock
def test_process_loops_end_concurrently(tmp_path: Path) -> None:
    """By when their halts begin, each of which rests for a quarter of a second."""
    names = [f"loop{i}" for i in range(6)]
    there: set[str] = set()

    def arrived(task: Any, task_id: Any) -> Any:
        there.add(task.name)
        return tasks.terminate("all there") if there == set(names) else None

    output_file = tmp_path / "told"
    slow = [
        loops.StepsFactory(loops.store_name, str(output_file), name=name, rate_hz=10, halt=loops.rest) for name in names
    ]
    run(*slow, FunctionEndpointFactory({TaskType.store_page: arrived}))
    begun_s = sorted(map(float, output_file.read_text().split()))
    assert len(begun_s) == 6
    assert begun_s[-1] - begun_s[0] < 5 * 0.25  # what it takes in turn
    assert median(later - earlier for earlier, later in pairwise(begun_s)) < 0.25 / 2


@pytest.mark.slow
def test_large_arrays_arrive_complete_and_in_order() -> None:
    node = run(loops.StepsFactory(loops.store_array))
    for i in range(20):
        data = node.get_data(f"frame{i}")
        assert data["image"].shape == (300, 200, 3)
        assert data["image"].dtype == np.uint8
        assert (data["image"] == i).all()
        assert data["small"].tolist() == [0.5, i]


@pytest.mark.slow
def test_requested_pages_of_any_size_reach_loop_with_previous_page() -> None:
    expected = {"sum": 6e5, "before": 6e5}

    def ask(loop: Any) -> None:
        loop.store_data("question", np.full(300_000, 1.0 if loop.parent.get_page("question") is None else 2.0))

    def done(task: Any, task_id: Any) -> Any:
        return tasks.terminate("answered") if task.val_list[0].data == expected else None

    answers = FunctionEndpointFactory({(TaskType.store_page, "answer"): done})
    node = run(loops.StepsFactory(loops.answer), FunctionLoopFactory(ask, "asker", 20), answers)
    assert node.get_data("answer") == expected


@pytest.mark.slow
def test_skipped_pages_are_counted() -> None:
    def ask(loop: Any) -> None:
        for _ in range(1000):
            loop.store_data("question", np.ones(1))

    def on_answer(task: Any, task_id: Any) -> Any:
        return tasks.terminate("counted") if backing_of(node).skipped else None

    answers = FunctionEndpointFactory({(TaskType.store_page, "answer"): on_answer})
    node = node_of(loops.StepsFactory(loops.answer), FunctionLoopFactory(ask, "asker", 20), answers)
    node.loop()
    assert node.exit_reason == "counted"


@pytest.mark.slow
def test_non_text_key_returns_none_in_process() -> None:
    assert run(loops.StepsFactory(loops.ask_for_seven)).get_data("answer") == "none"


@pytest.mark.slow
def test_unsendable_object_in_process_raises_at_student_line() -> None:
    with pytest.raises(ComponentFailedError, match="store_page 'frame' holds an object that cannot be sent") as caught:
        run(loops.StepsFactory(loops.store_object))
    assert 'loop.store_data("frame", Frame())' in str(caught.value).splitlines()[0]


@pytest.mark.slow
def test_unsendable_page_fails_requesting_loop() -> None:
    store = FunctionLoopFactory(lambda loop: loop.store_data("question", threading.Event()), "asker", 20)
    with pytest.raises(ComponentFailedError, match="page 'question' holds an object that cannot be sent"):
        run(loops.StepsFactory(loops.answer), store)


@pytest.mark.slow
def test_log_records_of_loop_are_logged_by_node(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "snr"):
        run(loops.StepsFactory(loops.log_something))
    assert ("snr.r_node.worker", logging.WARNING, "lens dirty") in caplog.record_tuples


def test_unpicklable_factory_raises_when_node_begins() -> None:
    message = r"StepsFactory's attribute `given\[0\]` cannot be sent there: lock"
    with pytest.raises(ComponentFailedError, match=message) as caught:
        run(loops.StepsFactory(loops.nothing, threading.Lock()))
    assert "setup()" in str(caught.value)


@pytest.mark.slow
def test_node_does_not_wait_for_starting_process_at_end(tmp_path: Path) -> None:
    output_file, gate = tmp_path / "told", tmp_path / "gate"
    os.mkfifo(gate)  # never opened for writing, so the process never finishes starting
    quitter = FunctionEndpointFactory(begin=lambda part: part.schedule(tasks.terminate("at once")))
    node = node_of(loops.GatedFactory(loops.write_halt, str(output_file), str(gate), setup=loops.write_halt), quitter)
    node.loop()
    assert not output_file.exists()
    assert node.notes == []


@pytest.mark.slow
def test_process_loop_can_be_removed_and_added_again() -> None:
    pids: list[int] = []
    factory = loops.StepsFactory(loops.store_pid)

    def seen(task: Any, task_id: Any) -> Any:
        pid = task.val_list[0].data
        if pid in pids:
            return None
        pids.append(pid)
        return tasks.terminate("two") if len(pids) == 2 else tasks.reload_component("worker")

    node = run(factory, FunctionEndpointFactory({(TaskType.store_page, "pid"): seen}))
    assert len(set(pids)) == 2
    assert [listeners for listeners in node.datastore.listeners.values() if listeners] == []


@pytest.mark.slow
def test_process_loop_leaks_no_descriptor_or_thread() -> None:
    run(loops.StepsFactory(loops.store_array))  # what is made once stays
    before, threads = len(os.listdir("/proc/self/fd")), threading.active_count()
    for crash in (loops.store_array, loops.kill_itself):
        with suppress(ComponentFailedError):
            run(loops.StepsFactory(crash))
    assert len(os.listdir("/proc/self/fd")) == before
    assert threading.active_count() <= threads
