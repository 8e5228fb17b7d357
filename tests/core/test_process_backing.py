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
from snr_sim.core.process.process_backing import ProcessBacking
from snr_sim.prelude.errors import ComponentFailed
from snr_sim.scenario.library import load_program
from snr_sim.testing.parts import PartFactory, TickerFactory

loops: Any = load_program(str(Path(__file__).parent / "process_loops.py"))

LIMIT_S = 60.0  # for what takes a fraction of a second on a machine that has nothing else to do


def node_of(*factories: Any, mode: Mode = Mode.TEST) -> Node:
    return Node("r", Config(mode, {"r": [*factories, TimeoutLoopFactory(seconds=LIMIT_S)]}))


def run(*factories: Any) -> Node:
    node = node_of(*factories)
    node.loop()
    assert node.exit_reason != "timeout"
    return node


def backing_of(node: Node, name: str = "worker") -> ProcessBacking:
    backing = node.components[name]._backing  # type: ignore[attr-defined]
    assert isinstance(backing, ProcessBacking)
    return backing


def ends_at(key: str, name: str = "listener") -> PartFactory:
    return PartFactory({(TaskType.store_page, key): lambda task, task_id: tasks.terminate(key)}, name)


@pytest.mark.slow
def test_a_loop_runs_in_another_process_with_the_nodes_role_and_time() -> None:
    before_s = time.monotonic()
    node = run(loops.StepsFactory(loops.say_where))
    page = node.get_page("where")
    assert page is not None
    assert page.data["pid"] != os.getpid()
    assert page.data["role"] == "r"
    assert page.origin == "r_node"
    assert page.data["time_s"] <= page.created_at_s <= time.monotonic() - before_s


def test_in_lock_step_the_clock_calls_such_a_loop_here_as_any_other() -> None:
    node = Node("r", Config(Mode.TEST, {"r": [loops.StepsFactory(loops.say_where)]}), clock=SimClock())
    node.loop()
    page = node.get_page("where")
    assert page is not None
    assert page.data == {"pid": os.getpid(), "time_s": 0.0, "role": "r"}


def test_a_backing_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ComponentFailed, match="Loop 'worker' has backing = 'proces'"):
        run(loops.StepsFactory(loops.nothing, backing="proces"))


@pytest.mark.slow
def test_ticks_and_lateness_and_times_reach_the_node_also_from_a_process_that_stopped_itself() -> None:
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
def test_an_exception_in_the_process_is_the_loops_failure_with_the_students_line_first(step: str) -> None:
    halted: list[str] = []
    motor = PartFactory(name="motor", halt=lambda part: halted.append("motor"))
    factory = loops.StepsFactory(loops.end, **({step: loops.raise_error} if step != "loop" else {}))
    factory.steps["loop"] = loops.raise_error if step == "loop" else loops.end
    with pytest.raises(ComponentFailed) as caught:
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
    ("crash", "said"),
    [
        ("exit_python", "SystemExit: 3"),
        ("exit_at_once", "ended with exit status 3"),
        ("exit_at_once", "bus voltage 9.1 V"),
        ("kill_itself", "was ended by SIGKILL"),
        ("read_nowhere", "was ended by SIGSEGV"),
        ("read_nowhere", "read_nowhere"),  # the line that Python itself prints at such a crash
    ],
)
def test_a_crash_of_the_process_is_an_error_of_the_loop(crash: str, said: str) -> None:
    halted: list[str] = []
    motor = PartFactory(name="motor", halt=lambda part: halted.append("motor"))
    with pytest.raises(ComponentFailed, match=said) as caught:
        run(motor, loops.StepsFactory(getattr(loops, crash)))
    assert caught.value.component == "worker"
    assert "worker" in str(caught.value)
    assert halted == ["motor"]


@pytest.mark.slow
def test_a_killed_process_is_noticed_although_somebody_it_forked_holds_its_line(tmp_path: Path) -> None:
    told = tmp_path / "told"
    node = node_of(loops.StepsFactory(loops.start_another, str(told)))
    start_s = time.monotonic()
    with pytest.raises(ComponentFailed, match="SIGKILL"):
        node.loop()
    os.kill(int(told.read_text()), signal.SIGKILL)
    assert time.monotonic() - start_s < 50.0  # it sleeps for 60


@pytest.mark.slow
def test_halt_and_terminate_are_called_in_the_process_and_only_there(tmp_path: Path) -> None:
    told = tmp_path / "told"
    run(loops.StepsFactory(loops.end, str(told), halt=loops.write_halt, terminate=loops.write_terminate))
    words = [line.split() for line in told.read_text().splitlines()]
    assert [word for word, _ in words] == ["halt", "terminate"]
    assert str(os.getpid()) not in {pid for _, pid in words}


@pytest.mark.wall_clock
def test_a_loop_that_hangs_is_halted_from_outside_and_does_not_hold_up_the_end(tmp_path: Path) -> None:
    told = tmp_path / "told"

    def is_halted() -> bool:
        """On a busy machine its process may not come to it in time, and is killed."""
        node = node_of(loops.StepsFactory(loops.hang, str(told), halt=loops.write_halt), ends_at("pid"))
        node.loop()
        return told.exists() and any(note.startswith("Loop 'worker' did not end within 0.5 s") for note in node.notes)

    assert any(is_halted() for _ in range(4))


@pytest.mark.slow
def test_a_process_that_cannot_even_be_asked_is_killed_and_the_run_says_so() -> None:
    node = node_of(loops.StepsFactory(loops.hang_in_c), ends_at("pid"))
    node.loop()
    assert any("did not end within 0.8 s and was killed" in note for note in node.notes)
    with pytest.raises(ProcessLookupError):
        os.kill(node.get_data("pid"), 0)  # no zombie either


@pytest.mark.wall_clock
def test_loops_in_processes_end_together_and_not_one_after_the_other(tmp_path: Path) -> None:
    """By when their halts begin, each of which rests for a quarter of a second."""
    names = [f"loop{i}" for i in range(6)]
    there: set[str] = set()

    def arrived(task: Any, task_id: Any) -> Any:
        there.add(task.name)
        return tasks.terminate("all there") if there == set(names) else None

    told = tmp_path / "told"
    slow = [loops.StepsFactory(loops.store_name, str(told), name=name, rate_hz=10, halt=loops.rest) for name in names]
    run(*slow, PartFactory({TaskType.store_page: arrived}))
    begun_s = sorted(map(float, told.read_text().split()))
    assert len(begun_s) == 6
    assert begun_s[-1] - begun_s[0] < 5 * 0.25  # what it takes in turn
    assert median(later - earlier for earlier, later in pairwise(begun_s)) < 0.25 / 2


@pytest.mark.slow
def test_large_arrays_arrive_whole_and_in_order() -> None:
    node = run(loops.StepsFactory(loops.store_array))
    for i in range(20):
        data = node.get_data(f"frame{i}")
        assert data["image"].shape == (300, 200, 3)
        assert data["image"].dtype == np.uint8
        assert (data["image"] == i).all()
        assert data["small"].tolist() == [0.5, i]


@pytest.mark.slow
def test_pages_that_the_loop_asks_for_reach_it_with_the_one_before_and_whatever_their_size() -> None:
    expected = {"sum": 6e5, "before": 6e5}

    def ask(loop: Any) -> None:
        loop.store_data("question", np.full(300_000, 1.0 if loop.parent.get_page("question") is None else 2.0))

    def done(task: Any, task_id: Any) -> Any:
        return tasks.terminate("answered") if task.val_list[0].data == expected else None

    answers = PartFactory({(TaskType.store_page, "answer"): done})
    node = run(loops.StepsFactory(loops.answer), TickerFactory(ask, "asker", 20), answers)
    assert node.get_data("answer") == expected


@pytest.mark.slow
def test_pages_that_are_replaced_before_they_were_sent_to_the_process_are_counted() -> None:
    def ask(loop: Any) -> None:
        for _ in range(1000):
            loop.store_data("question", np.ones(1))

    def heard(task: Any, task_id: Any) -> Any:
        return tasks.terminate("counted") if backing_of(node).skipped else None

    answers = PartFactory({(TaskType.store_page, "answer"): heard})
    node = node_of(loops.StepsFactory(loops.answer), TickerFactory(ask, "asker", 20), answers)
    node.loop()
    assert node.exit_reason == "counted"


@pytest.mark.slow
def test_a_page_whose_name_is_no_text_is_not_there_as_in_any_loop() -> None:
    assert run(loops.StepsFactory(loops.ask_for_seven)).get_data("answer") == "none"


@pytest.mark.slow
def test_an_object_that_cannot_leave_the_process_is_told_at_the_students_line() -> None:
    with pytest.raises(ComponentFailed, match="store_page 'frame' holds an object that cannot be sent") as caught:
        run(loops.StepsFactory(loops.store_object))
    assert 'loop.store_data("frame", Frame())' in str(caught.value).splitlines()[0]


@pytest.mark.slow
def test_an_object_that_cannot_go_into_the_process_is_an_error_of_the_loop_that_asks_for_it() -> None:
    store = TickerFactory(lambda loop: loop.store_data("question", threading.Event()), "asker", 20)
    with pytest.raises(ComponentFailed, match="page 'question' holds an object that cannot be sent"):
        run(loops.StepsFactory(loops.answer), store)


@pytest.mark.slow
def test_what_the_loop_logs_is_logged_by_the_node(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "snr"):
        run(loops.StepsFactory(loops.log_something))
    assert ("snr.r_node.worker", logging.WARNING, "lens dirty") in caplog.record_tuples


def test_what_cannot_be_sent_to_a_process_is_named_when_the_node_begins() -> None:
    said = r"StepsFactory's attribute `given\[0\]` cannot be sent there: lock"
    with pytest.raises(ComponentFailed, match=said) as caught:
        run(loops.StepsFactory(loops.nothing, threading.Lock()))
    assert "setup()" in str(caught.value)


@pytest.mark.slow
def test_a_node_that_ends_while_its_process_still_starts_does_not_wait_for_it(tmp_path: Path) -> None:
    told, gate = tmp_path / "told", tmp_path / "gate"
    os.mkfifo(gate)  # never opened for writing, so the process never finishes starting
    quitter = PartFactory(begin=lambda part: part.schedule(tasks.terminate("at once")))
    node = node_of(loops.GatedFactory(loops.write_halt, str(told), str(gate), setup=loops.write_halt), quitter)
    node.loop()
    assert not told.exists()
    assert node.notes == []


@pytest.mark.slow
def test_a_loop_in_a_process_can_be_removed_and_made_anew_while_its_node_runs() -> None:
    pids: list[int] = []
    factory = loops.StepsFactory(loops.store_pid)

    def seen(task: Any, task_id: Any) -> Any:
        pid = task.val_list[0].data
        if pid in pids:
            return None
        pids.append(pid)
        return tasks.terminate("two") if len(pids) == 2 else tasks.reload_component("worker")

    node = run(factory, PartFactory({(TaskType.store_page, "pid"): seen}))
    assert len(set(pids)) == 2
    core = node.components["node_core"]
    assert [taps for taps in core.taps.values() if taps] == []  # type: ignore[attr-defined]


@pytest.mark.slow
def test_no_descriptor_and_no_thread_is_left_behind() -> None:
    run(loops.StepsFactory(loops.store_array))  # what is made once stays
    before, threads = len(os.listdir("/proc/self/fd")), threading.active_count()
    for crash in (loops.store_array, loops.kill_itself):
        with suppress(ComponentFailed):
            run(loops.StepsFactory(crash))
    assert len(os.listdir("/proc/self/fd")) == before
    assert threading.active_count() <= threads
