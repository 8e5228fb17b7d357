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
from snr_sim.core.interrupts import RunInterrupted, graceful_shutdown
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

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
def test_signal_just_before_sleep_ends_run(number: int, capfd: pytest.CaptureFixture[str]) -> None:
    """Python has set its flag but the sleep continues: as with `interrupt_main`, which does not wake a thread."""

    def sleeps(task: Any, task_id: Any) -> None:
        threading.Timer(0.05, _thread.interrupt_main, [number]).start()
        time.sleep(60)

    worker = FunctionEndpointFactory(
        {TaskType.event: sleeps}, "worker", begin=lambda part: part.schedule(tasks.event("work"))
    )
    began_s = time.monotonic()
    runner = SynchronousRunner("r", Config(factories={"r": [worker]}))
    runner.run()
    name = signal.Signals(number).name
    assert f"note: {name}: component 'worker' did not return, and was interrupted." in capfd.readouterr().err
    assert time.monotonic() - began_s < 30.0
    assert [thread for thread in threading.enumerate() if thread.name == "wake_up"] == []
    assert signal.set_wakeup_fd(-1) == -1


@pytest.mark.slow
@pytest.mark.unmeasured
def test_signal_to_forked_child_does_not_end_parent() -> None:
    def fork_and_end(task: Any, task_id: Any) -> Any:
        pid = os.fork()
        if pid == 0:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.2)
            os._exit(0)
        os.waitpid(pid, 0)
        time.sleep(0.5)
        return tasks.terminate("by itself")

    worker = FunctionEndpointFactory(
        {TaskType.event: fork_and_end}, "worker", begin=lambda part: part.schedule(tasks.event("work"))
    )
    runner = TestRunner(Config(factories={"test": [worker]}))
    runner.run()
    assert runner.node.exit_reason == "by itself"


@pytest.mark.slow
def test_surviving_forked_child_does_not_delay_shutdown() -> None:
    copies: list[int] = []

    def fork(task: Any, task_id: Any) -> Any:
        pid = os.fork()
        if pid == 0:
            time.sleep(60)
            os._exit(0)
        copies.append(pid)
        return tasks.terminate("by itself")

    worker = FunctionEndpointFactory(
        {TaskType.event: fork}, "worker", begin=lambda part: part.schedule(tasks.event("work"))
    )
    began_s = time.monotonic()
    try:
        TestRunner(Config(factories={"test": [worker]})).run()
        assert time.monotonic() - began_s < 30.0
    finally:
        for pid in copies:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)


def sends(*numbers: int) -> FunctionLoopFactory:
    def send(loop: Any) -> None:
        for number in numbers:
            signal.raise_signal(number)

    return FunctionLoopFactory(send, "sender", 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_is_a_terminate_task_whose_reason_is_its_name(name: str) -> None:
    log: list[str] = []
    motor = FunctionEndpointFactory(
        {TaskType.terminate: lambda task, task_id: log.append(task.name)}, halt=lambda part: log.append("halt")
    )
    runner = TestRunner(Config(factories={"test": [motor, sends(getattr(signal, name))]}))
    runner.run()
    assert runner.node.exit_reason == name
    assert log == [name, "halt"]


@pytest.mark.slow
def test_a_signal_ends_all_nodes_of_a_simulated_run() -> None:
    config = Config(factories={"a": [sends(signal.SIGINT)], "b": [FunctionLoopFactory()], "c": []})
    runner = SimRunner(config, until_s=100.0)
    runner.run()
    assert runner.signals == ["SIGINT"]
    assert [node.exit_reason for node in runner.nodes.values()] == ["SIGINT"] * 3


@pytest.mark.slow
def test_signal_keeps_queued_tasks() -> None:
    handled: list[str] = []
    listener = FunctionEndpointFactory({TaskType.event: lambda task, task_id: handled.append(task.name)})

    def bring(loop: Any) -> None:
        loop.schedule([tasks.event(name) for name in "abc"])
        signal.raise_signal(signal.SIGTERM)

    TestRunner(Config(factories={"test": [listener, FunctionLoopFactory(bring)]})).run()
    assert handled == ["a", "b", "c"]


@pytest.mark.slow
def test_a_second_signal_interrupts_a_component_at_once() -> None:
    halted: list[str] = []

    def spin(task: Any, task_id: Any) -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
        halted.append("not reached")

    spinner = FunctionEndpointFactory(
        {TaskType.event: spin},
        begin=lambda part: part.schedule(tasks.event("go")),
        halt=lambda part: halted.append("halt"),
    )
    with pytest.raises(RunInterrupted, match="component 'part' did not return"):
        TestRunner(Config(factories={"test": [spinner]})).run()
    assert halted == ["halt"]


@pytest.mark.slow
def test_repeated_signals_do_not_prevent_halt() -> None:
    halted: list[str] = []

    def stop_motor(part: Any) -> None:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGINT):
            signal.raise_signal(number)
        halted.append(part.name)

    motors = [FunctionEndpointFactory(name=name, halt=stop_motor) for name in "abc"]
    TestRunner(Config(factories={"test": [*motors, sends(signal.SIGINT)]})).run()
    assert halted == ["a", "b", "c"]


@pytest.mark.wall_clock
def test_halt_timeout_is_per_component(monkeypatch: pytest.MonkeyPatch) -> None:
    grace_period_s = 1.0
    monkeypatch.setattr(interrupts, "GRACE_PERIOD_S", grace_period_s)
    halted: list[str] = []

    def stop_slowly(part: Any) -> None:
        time.sleep(0.4 * grace_period_s)  # so that a busy computer has as much again
        halted.append(part.name)

    motors = [FunctionEndpointFactory(name=name, halt=stop_slowly) for name in "abc"]
    TestRunner(Config(factories={"test": [*motors, sends(signal.SIGINT)]})).run()
    assert halted == ["a", "b", "c"]


@pytest.mark.wall_clock
def test_a_halt_that_never_returns_does_not_keep_others_from_being_halted() -> None:
    halted: list[str] = []

    def spin(part: Any) -> None:
        halted.append("stuck")
        while True:
            pass

    parts = [
        FunctionEndpointFactory(name="stuck", halt=spin),
        FunctionEndpointFactory(name="motor", halt=lambda part: halted.append("motor")),
    ]
    start_s = time.monotonic()
    with pytest.raises(ComponentFailedError, match="component 'stuck' did not return"):
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

    spinner = FunctionEndpointFactory(
        {TaskType.event: spin},
        "spinner",
        begin=lambda part: part.schedule(tasks.event("go")),
        halt=lambda part: halted.append("spinner"),
    )
    with pytest.raises(RunInterrupted, match="component 'spinner' did not return"):
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
    config = Config(
        factories={"a": [FunctionLoopFactory(), FunctionEndpointFactory(halt=lambda part: halted.append("part"))]}
    )
    with pytest.raises(RunInterrupted, match="the plant"):
        SimRunner(config, clock=clock).run()
    assert halted == ["part"]


@pytest.mark.slow
def test_signal_handlers_are_restored_after_run() -> None:
    watched = [signal.SIGINT, signal.SIGTERM, signal.SIGALRM]
    before = [signal.getsignal(number) for number in watched]
    TestRunner(Config(factories={"test": [sends(signal.SIGINT)]})).run()
    assert [signal.getsignal(number) for number in watched] == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.slow
def test_in_another_thread_than_the_main_one_a_run_works_without_signals() -> None:
    results: list[Any] = []

    def run() -> None:
        with graceful_shutdown([]) as caught:
            runner = SynchronousRunner(
                "r",
                Config(
                    factories={"r": [FunctionEndpointFactory(begin=lambda part: part.schedule(tasks.terminate("x")))]}
                ),
            )
            runner.run()
            results.extend([caught, runner.node.exit_reason])

    thread = threading.Thread(target=run)
    thread.start()
    thread.join(60.0)
    assert results == [[], "x"]
