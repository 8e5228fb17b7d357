"""Virtual time: exact deadlines, a defined order of simultaneous tasks, and an end when no task is left."""

import socket
import time
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import Config, Node, SimClock, SomeTasks, Task, TaskType, WallClock, tasks
from snr_sim.core.lockstep import NO_MORE_EVENTS, TIME_LIMIT, LockStep
from snr_sim.prelude.errors import ClockError, ComponentFailedError
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory


def node_of(*factories: Any, role: str = "r", clock: SimClock | None = None) -> Node:
    return Node(role, Config(factories={role: list(factories)}), clock=clock or SimClock())


def ender(after_s: float) -> FunctionLoopFactory:
    def end(loop: Any) -> None:
        if loop.get_time_s() >= after_s:
            loop.schedule(tasks.terminate("done"))

    return FunctionLoopFactory(end, "ender", 1.0)


@given(st.floats(0.5, 2000.0))
def test_tick_k_comes_at_exactly_k_over_the_rate(rate_hz: float) -> None:
    times: list[float] = []

    def tick(loop: Any) -> None:
        times.append(loop.get_time_s())
        if len(times) == 300:
            loop.stop()

    node_of(FunctionLoopFactory(tick, rate_hz=rate_hz)).loop()
    assert times == [k / rate_hz for k in range(300)]
    exact = Fraction(299) / Fraction(rate_hz)
    assert abs(Fraction(times[-1]) - exact) <= exact * Fraction(2) ** -52  # no drift: rounded once


@pytest.mark.slow
@pytest.mark.parametrize("clock", [SimClock, WallClock])
def test_next_tick_at_s_sets_next_tick(clock: type) -> None:
    moments_s = [0.0, 0.001, 0.01, 0.01, 0.05]
    came: list[float] = []

    def tick(loop: Any) -> None:
        came.append(loop.get_time_s())
        if len(came) == len(moments_s):
            loop.schedule(tasks.terminate("done"))
            loop.stop()
        else:
            loop.next_tick_at_s = moments_s[len(came)]

    Node("r", Config(factories={"r": [FunctionLoopFactory(tick, rate_hz=1)]}), clock=clock()).loop()
    if clock is SimClock:
        assert came == moments_s
    assert all(came_s >= expected_s for came_s, expected_s in zip(came, moments_s, strict=True))
    assert len(came) == 5


def test_work_in_a_tick_does_not_slow_a_loop_down() -> None:
    ticks: list[float] = []

    def work(loop: Any) -> None:
        ticks.append(loop.get_time_s())
        sum(range(10_000))

    node_of(FunctionLoopFactory(work, rate_hz=100), ender(2.0)).loop()
    assert len(ticks) == 201


def test_ticks_at_equal_instants_run_in_component_order() -> None:
    log: list[tuple[float, str]] = []

    def logs(name: str) -> Any:
        return lambda loop: log.append((loop.get_time_s(), name))

    loops = [FunctionLoopFactory(logs(name), name, rate) for name, rate in (("slow", 10), ("fast", 30), ("mid", 20))]
    node_of(*loops, ender(1.0)).loop()
    order = [name for moment, name in log if moment == 0.5]
    assert order == ["slow", "fast", "mid"]
    assert [name for moment, name in log if moment == 1.0] == ["slow", "fast", "mid"]


def test_inputs_of_loop_are_executed_before_next_loop_of_same_instant() -> None:
    log: list[str] = []
    listener = FunctionEndpointFactory({TaskType.event: lambda task, task_id: log.append(f"handle {task.name}")})

    def brings(name: str) -> FunctionLoopFactory:
        def bring(loop: Any) -> None:
            log.append(f"tick {name}")
            loop.schedule(tasks.event(name))
            loop.stop()

        return FunctionLoopFactory(bring, name)

    node_of(brings("a"), brings("b"), listener).loop()
    assert log == ["tick a", "handle a", "tick b", "handle b"]


def test_an_unlimited_loop_runs_at_1000_hz_so_that_time_can_move() -> None:
    ticks: list[float] = []
    node_of(FunctionLoopFactory(lambda loop: ticks.append(loop.get_time_s()), rate_hz=0), ender(1.0)).loop()
    assert ticks[:3] == [0.0, 0.001, 0.002]


def test_a_run_ends_when_nothing_is_due_any_more() -> None:
    node = node_of(FunctionLoopFactory(lambda loop: loop.stop()))
    node.loop()
    assert node.exit_reason == NO_MORE_EVENTS


def test_a_run_ends_at_its_time_limit_inclusive() -> None:
    times: list[float] = []
    clock = SimClock()
    node = node_of(FunctionLoopFactory(lambda loop: times.append(loop.get_time_s()), rate_hz=10), clock=clock)
    LockStep([node], clock, until_s=0.5).run()
    assert node.exit_reason == TIME_LIMIT
    assert times[-1] == 0.5


def test_a_handler_that_sleeps_is_refused_under_the_virtual_clock() -> None:
    def doze(task: Task, task_id: Any) -> None:
        node.clock.sleep_until(node.clock.now_s() + 1.0)

    node = node_of(
        FunctionEndpointFactory({TaskType.event: doze}, begin=lambda part: part.schedule(tasks.event("doze")))
    )
    with pytest.raises(ComponentFailedError, match=r"slept until 1.000 s(.|\n)*max_tick_rate_hz"):
        node.loop()


def test_the_past_cannot_be_scheduled() -> None:
    clock = SimClock()
    clock.call_at(1.0, lambda: None)
    clock.run_next()
    with pytest.raises(ClockError, match=r"called at 0.500000 s, but it is already 1.000000 s"):
        clock.call_at(0.5, lambda: None)
    clock.sleep_until(0.5)  # has passed: returns at once


def test_followers_are_brought_to_each_new_moment_before_anything_due_then() -> None:
    clock = SimClock()
    log: list[str] = []
    clock.follow(lambda time_s: log.append(f"plant at {time_s}"))
    for name, order in (("loop", 0), ("link", -1), ("late", 0)):
        clock.call_at(0.5, lambda name=name: log.append(name), order)
    clock.call_at(1.0, lambda: log.append("next"))
    while clock.next_s is not None:
        clock.run_next()
    assert log == ["plant at 0.5", "link", "loop", "late", "plant at 1.0", "next"]


def test_a_plant_that_fails_still_lets_the_nodes_be_halted() -> None:
    halted: list[str] = []
    clock = SimClock()

    def explode(time_s: float) -> None:
        raise ValueError("physics")

    clock.follow(explode)
    node = node_of(
        FunctionLoopFactory(rate_hz=10), FunctionEndpointFactory(halt=lambda part: halted.append("part")), clock=clock
    )
    with pytest.raises(ValueError, match="physics"):
        node.loop()
    assert halted == ["part"]


def test_time_is_the_same_all_through_a_task_and_moves_between_ticks_only() -> None:
    seen: list[float] = []

    def look(task: Task, task_id: Any) -> SomeTasks:
        seen.append(node.get_time_s())
        return tasks.event("again") if len(seen) % 3 else None

    node = node_of(
        FunctionEndpointFactory({TaskType.event: look}),
        FunctionLoopFactory(lambda loop: loop.schedule(tasks.event("x")), rate_hz=4),
        ender(0.9),
    )
    node.loop()
    assert seen == [0.0, 0.0, 0.0, 0.25, 0.25, 0.25, 0.5, 0.5, 0.5, 0.75, 0.75, 0.75, 1.0, 1.0, 1.0]


def test_a_paced_run_takes_as_long_as_it_should() -> None:
    clock = SimClock()
    node = node_of(FunctionLoopFactory(rate_hz=100), clock=clock)
    start_s = time.monotonic()
    LockStep([node], clock, pace=10.0, until_s=1.0).run()
    assert 0.1 <= time.monotonic() - start_s < 0.5  # 1 s at the speed of the world


def test_paced_run_waits_after_its_first_node_has_ended() -> None:
    clock, (near, far) = SimClock(), socket.socketpair()
    with near, far:
        first = node_of(ender(1.0), role="a", clock=clock)
        first.inbox.watch(near.fileno(), lambda what: None, None)  # as a console does
        second = node_of(ender(2.0), role="b", clock=clock)
        LockStep([first, second], clock, pace=20.0).run()
    assert [first.exit_reason, second.exit_reason, clock.now_s()] == ["done", "done", 2.0]


def test_two_nodes_share_one_time_and_one_that_ends_does_not_end_the_other() -> None:
    clock = SimClock()
    ticks: dict[str, list[float]] = {"a": [], "b": []}
    nodes = [
        node_of(
            FunctionLoopFactory(lambda loop, role=role: ticks[role].append(loop.get_time_s()), rate_hz=10),
            ender(until_s),
            role=role,
            clock=clock,
        )
        for role, until_s in (("a", 1.0), ("b", 2.0))
    ]
    LockStep(nodes, clock).run()
    assert [node.exit_reason for node in nodes] == ["done", "done"]
    assert (ticks["a"][-1], ticks["b"][-1]) == (1.0, 2.0)


def test_a_failure_in_one_node_halts_all() -> None:
    halted: list[str] = []
    clock = SimClock()

    def fail(loop: Any) -> None:
        raise ValueError("sensor fell off")

    nodes = [
        node_of(
            FunctionEndpointFactory(halt=lambda part, role=role: halted.append(role)), *extra, role=role, clock=clock
        )
        for role, extra in (("a", []), ("b", [FunctionLoopFactory(fail)]), ("c", []))
    ]
    with pytest.raises(ComponentFailedError, match="sensor fell off"):
        LockStep(nodes, clock).run()
    assert halted == ["a", "b", "c"]


@pytest.mark.slow
def test_student_code_gives_the_same_pages_in_lock_step_and_on_threads() -> None:
    def pages(clock: Any) -> list[Any]:
        stored: list[Any] = []

        class Doubler(FunctionEndpointFactory):
            def get(self, parent: Node) -> Any:
                part = super().get(parent)

                def double(task: Task, task_id: Any) -> SomeTasks:
                    value = task.val_list[0].data
                    stored.append((value, part.get_data("x_prev")))
                    return tasks.terminate("done") if value == 9 else part.store_data_task("y", 2 * value)

                part.task_handlers = {(TaskType.store_page, "x"): double}
                return part

        left = iter(range(10))

        def bring(loop: Any) -> None:
            for value in left:
                loop.store_data("x", value)
                return

        node = Node("r", Config(factories={"r": [Doubler(), FunctionLoopFactory(bring, rate_hz=500)]}), clock=clock)
        node.loop()
        return [*stored, node.get_data("y"), node.exit_reason]

    assert pages(SimClock()) == pages(WallClock())
