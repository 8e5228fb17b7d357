"""Ctrl-C and SIGTERM at any moment: an orderly halt, soon, and no node that hangs."""

import _thread
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from statistics import median
from typing import Any

import pytest

from snr_sim import Config, SimClock, SimRunner, SynchronousRunner, TaskType, TestRunner, tasks
from snr_sim.core import interrupts
from snr_sim.core.interrupts import Interrupted, orderly
from snr_sim.prelude.errors import ComponentFailed
from snr_sim.testing.parts import PartFactory, TickerFactory

COUNT = 225  # fifteen of each kind
HERE = Path(__file__).parent


@pytest.mark.wall_clock
def test_weakness_1_nodes_interrupted_at_random_moments_all_halt_in_order_and_soon() -> None:
    command = [sys.executable, str(HERE / "interrupted.py"), str(COUNT), "20261"]
    environment = {**os.environ, "PYTHONPATH": str(HERE.parents[1])}
    children = json.loads(subprocess.check_output(command, env=environment, timeout=1200))
    assert len(children) == COUNT
    assert [child for child in children if child["status"] is None] == []  # had to be killed
    # b: begun, h: halted, t: terminated.
    assert [child for child in children if not child["wrote"].startswith("bht")] == []
    slow = [child for child in children if child["took_s"] > 1.0]
    assert len(slow) <= COUNT // 50, slow  # a busy computer may hold one up
    for kind in {child["kind"] for child in children}:
        took_s = [child["took_s"] for child in children if child["kind"] == kind]
        assert median(took_s) < 1.0, kind  # a hang holds up all of its kind


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_comes_just_before_a_handler_falls_asleep_ends_the_run_all_the_same(
    number: int, capfd: pytest.CaptureFixture[str]
) -> None:
    """Python has set its flag but the sleep continues: as with `interrupt_main`, which does not wake a thread."""

    def sleeps(task: Any, task_id: Any) -> None:
        threading.Timer(0.05, _thread.interrupt_main, [number]).start()
        time.sleep(60)

    worker = PartFactory({TaskType.event: sleeps}, "worker", begin=lambda part: part.schedule(tasks.event("work")))
    began_s = time.monotonic()
    runner = SynchronousRunner("r", Config(factories={"r": [worker]}))
    runner.run()
    name = signal.Signals(number).name
    assert f"note: {name}: component 'worker' did not return, and was interrupted." in capfd.readouterr().err
    assert time.monotonic() - began_s < 30.0
    assert [thread for thread in threading.enumerate() if thread.name == "wake_up"] == []
    assert signal.set_wakeup_fd(-1) == -1


@pytest.mark.slow
def test_a_signal_to_a_copy_of_the_process_is_not_taken_for_ours() -> None:
    def fork_and_end(task: Any, task_id: Any) -> Any:
        pid = os.fork()
        if pid == 0:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.2)
            os._exit(0)
        os.waitpid(pid, 0)
        time.sleep(0.5)
        return tasks.terminate("by itself")

    worker = PartFactory(
        {TaskType.event: fork_and_end}, "worker", begin=lambda part: part.schedule(tasks.event("work"))
    )
    runner = TestRunner(Config(factories={"test": [worker]}))
    runner.run()
    assert runner.node.exit_reason == "by itself"


@pytest.mark.slow
def test_a_copy_of_the_process_that_lives_on_holds_up_no_end() -> None:
    copies: list[int] = []

    def fork(task: Any, task_id: Any) -> Any:
        pid = os.fork()
        if pid == 0:
            time.sleep(60)
            os._exit(0)
        copies.append(pid)
        return tasks.terminate("by itself")

    worker = PartFactory({TaskType.event: fork}, "worker", begin=lambda part: part.schedule(tasks.event("work")))
    began_s = time.monotonic()
    try:
        TestRunner(Config(factories={"test": [worker]})).run()
        assert time.monotonic() - began_s < 30.0
    finally:
        for pid in copies:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)


def sends(*numbers: int) -> TickerFactory:
    def send(loop: Any) -> None:
        for number in numbers:
            signal.raise_signal(number)

    return TickerFactory(send, "sender", 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_is_a_terminate_task_whose_reason_is_its_name(name: str) -> None:
    log: list[str] = []
    motor = PartFactory(
        {TaskType.terminate: lambda task, task_id: log.append(task.name)}, halt=lambda part: log.append("halt")
    )
    runner = TestRunner(Config(factories={"test": [motor, sends(getattr(signal, name))]}))
    runner.run()
    assert runner.node.exit_reason == name
    assert log == [name, "halt"]


@pytest.mark.slow
def test_a_signal_ends_all_nodes_of_a_simulated_run() -> None:
    config = Config(factories={"a": [sends(signal.SIGINT)], "b": [TickerFactory()], "c": []})
    runner = SimRunner(config, until_s=100.0)
    runner.run()
    assert runner.signals == ["SIGINT"]
    assert [node.exit_reason for node in runner.nodes.values()] == ["SIGINT"] * 3


@pytest.mark.slow
def test_what_is_queued_at_a_signal_is_still_finished() -> None:
    handled: list[str] = []
    listener = PartFactory({TaskType.event: lambda task, task_id: handled.append(task.name)})

    def bring(loop: Any) -> None:
        loop.schedule([tasks.event(name) for name in "abc"])
        signal.raise_signal(signal.SIGTERM)

    TestRunner(Config(factories={"test": [listener, TickerFactory(bring)]})).run()
    assert handled == ["a", "b", "c"]


@pytest.mark.slow
def test_a_second_signal_interrupts_a_component_at_once() -> None:
    halted: list[str] = []

    def spin(task: Any, task_id: Any) -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
        halted.append("not reached")

    spinner = PartFactory(
        {TaskType.event: spin},
        begin=lambda part: part.schedule(tasks.event("go")),
        halt=lambda part: halted.append("halt"),
    )
    with pytest.raises(Interrupted, match="component 'part' did not return"):
        TestRunner(Config(factories={"test": [spinner]})).run()
    assert halted == ["halt"]


@pytest.mark.slow
def test_no_number_of_signals_keeps_motors_from_being_stopped() -> None:
    halted: list[str] = []

    def stop_motor(part: Any) -> None:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGINT):
            signal.raise_signal(number)
        halted.append(part.name)

    motors = [PartFactory(name=name, halt=stop_motor) for name in "abc"]
    TestRunner(Config(factories={"test": [*motors, sends(signal.SIGINT)]})).run()
    assert halted == ["a", "b", "c"]


@pytest.mark.wall_clock
def test_a_halt_has_its_own_time_however_long_others_took(monkeypatch: pytest.MonkeyPatch) -> None:
    patience_s = 1.0
    monkeypatch.setattr(interrupts, "PATIENCE_S", patience_s)
    halted: list[str] = []

    def stop_slowly(part: Any) -> None:
        time.sleep(0.4 * patience_s)  # so that a busy computer has as much again
        halted.append(part.name)

    motors = [PartFactory(name=name, halt=stop_slowly) for name in "abc"]
    TestRunner(Config(factories={"test": [*motors, sends(signal.SIGINT)]})).run()
    assert halted == ["a", "b", "c"]


@pytest.mark.wall_clock
def test_a_halt_that_never_returns_does_not_keep_others_from_being_halted() -> None:
    halted: list[str] = []

    def spin(part: Any) -> None:
        halted.append("stuck")
        while True:
            pass

    parts = [PartFactory(name="stuck", halt=spin), PartFactory(name="motor", halt=lambda part: halted.append("motor"))]
    start_s = time.monotonic()
    with pytest.raises(ComponentFailed, match="component 'stuck' did not return"):
        TestRunner(Config(factories={"test": [*parts, sends(signal.SIGINT)]})).run()
    assert halted == ["stuck", "motor"]
    assert time.monotonic() - start_s < 1.0


@pytest.mark.slow
def test_a_component_that_never_returns_is_interrupted_where_it_is_and_named() -> None:
    halted: list[str] = []

    def spin(task: Any, task_id: Any) -> None:
        signal.raise_signal(signal.SIGINT)
        while True:
            pass

    spinner = PartFactory(
        {TaskType.event: spin},
        "spinner",
        begin=lambda part: part.schedule(tasks.event("go")),
        halt=lambda part: halted.append("spinner"),
    )
    with pytest.raises(Interrupted, match="component 'spinner' did not return"):
        TestRunner(Config(factories={"test": [spinner]})).run()
    assert halted == ["spinner"]


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="this system has no interval timer")
def test_a_plant_that_never_returns_is_interrupted_too() -> None:
    halted: list[str] = []
    clock = SimClock()

    def hang(time_s: float) -> None:
        if time_s >= 0.01:
            signal.raise_signal(signal.SIGINT)
            while True:
                pass

    clock.follow(hang)
    config = Config(factories={"a": [TickerFactory(), PartFactory(halt=lambda part: halted.append("part"))]})
    with pytest.raises(Interrupted, match="the plant"):
        SimRunner(config, clock=clock).run()
    assert halted == ["part"]


@pytest.mark.slow
def test_afterwards_signals_mean_what_they_meant_before() -> None:
    watched = [signal.SIGINT, signal.SIGTERM, signal.SIGALRM]
    before = [signal.getsignal(number) for number in watched]
    TestRunner(Config(factories={"test": [sends(signal.SIGINT)]})).run()
    assert [signal.getsignal(number) for number in watched] == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.slow
def test_in_another_thread_than_the_main_one_a_run_works_without_signals() -> None:
    results: list[Any] = []

    def run() -> None:
        with orderly([]) as caught:
            runner = SynchronousRunner(
                "r", Config(factories={"r": [PartFactory(begin=lambda part: part.schedule(tasks.terminate("x")))]})
            )
            runner.run()
            results.extend([caught, runner.node.exit_reason])

    thread = threading.Thread(target=run)
    thread.start()
    thread.join(60.0)
    assert results == [[], "x"]
