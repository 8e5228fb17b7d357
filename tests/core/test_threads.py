"""Loops on threads of their own: rates, shutdown, failures, and the one door through which they meet the node."""

import threading
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from snr_sim import Config, Node, SomeTasks, Task, TaskType, TimeoutLoopFactory, WallClock, tasks
from snr_sim.core.backing import JOIN_TIMEOUT_S
from snr_sim.core.door import Door
from snr_sim.prelude.errors import ComponentFailed, ParameterError
from snr_sim.testing.parts import PartFactory, TickerFactory


def node_of(*factories: Any) -> Node:
    return Node("r", Config(factories={"r": list(factories)}), clock=WallClock())


def run_s(node: Node) -> float:
    start_s = time.monotonic()
    node.loop()
    return time.monotonic() - start_s


def holds_once(attempt: Callable[[], bool]) -> bool:
    """Whether a measurement of this computer comes out at least once of four: it may be busy, but not always."""
    return any(attempt() for _ in range(4))


def test_weakness_5_an_idle_node_costs_nothing() -> None:
    def is_cheap() -> bool:
        node = node_of(PartFactory({TaskType.event: lambda task, task_id: None}))
        threading.Timer(0.4, lambda: node.schedule(tasks.terminate("enough"))).start()
        before_s = time.process_time()
        took_s = run_s(node)
        assert node.exit_reason == "enough"
        return time.process_time() - before_s < 0.01 * took_s

    assert holds_once(is_cheap)


def test_a_node_whose_loops_wait_costs_nothing_either() -> None:
    def is_cheap() -> bool:
        node = node_of(TimeoutLoopFactory(seconds=0.4), TickerFactory(rate_hz=5))
        before_s = time.process_time()
        took_s = run_s(node)
        assert node.exit_reason == "timeout"
        return time.process_time() - before_s < 0.01 * took_s

    assert holds_once(is_cheap)


def test_a_node_that_sleeps_is_woken_at_once() -> None:
    def is_prompt() -> bool:
        node = node_of(PartFactory())
        threading.Timer(0.05, lambda: node.schedule(tasks.terminate("enough"))).start()
        return run_s(node) < 0.08

    assert holds_once(is_prompt)


@pytest.mark.parametrize("rate_hz", [50, 100, 500])
def test_weakness_26_a_loop_on_a_thread_keeps_its_mean_rate_although_it_works(rate_hz: int) -> None:
    def keeps_rate() -> bool:
        ticks: list[float] = []

        def work(loop: Any) -> None:
            ticks.append(time.monotonic())
            time.sleep(0.5 / rate_hz)  # half of the period goes into the work itself

        run_s(node_of(TickerFactory(work, rate_hz=rate_hz), TimeoutLoopFactory(seconds=0.4)))
        mean_hz = (len(ticks) - 1) / (ticks[-1] - ticks[0])
        return abs(mean_hz / rate_hz - 1.0) < 0.02  # a wait of one period after the work: 33 % off

    assert holds_once(keeps_rate)


def test_a_loop_that_cannot_keep_up_leaves_ticks_out_and_does_not_hurry_after_them() -> None:
    ticks: list[float] = []

    def work(loop: Any) -> None:
        ticks.append(loop.get_time_s())
        if len(ticks) == 3:
            time.sleep(0.1)

    run_s(node_of(TickerFactory(work, rate_hz=100), TimeoutLoopFactory(seconds=0.3)))
    gaps = [later - earlier for earlier, later in pairwise(ticks)]
    assert sum(gap < 0.004 for gap in gaps) <= 2
    assert max(gaps) > 0.09


def test_a_timeout_does_not_hold_up_the_end() -> None:
    stop = TickerFactory(lambda loop: loop.schedule(tasks.terminate("stop")), "stop")
    assert run_s(node_of(TimeoutLoopFactory(seconds=30), stop)) < 0.4


def test_weakness_17_fifty_loops_at_10_hz_end_together_and_not_one_after_the_other() -> None:
    def is_quick() -> bool:
        asked_s: list[float] = []

        def stop(loop: Any) -> None:
            asked_s.append(time.monotonic())
            loop.schedule(tasks.terminate("stop"))

        slow = [TickerFactory(name=f"slow{i}", rate_hz=10) for i in range(50)]
        node_of(*slow, TickerFactory(stop, "stop")).loop()
        return time.monotonic() - asked_s[0] < 0.3

    assert holds_once(is_quick)


def test_loops_that_hang_are_halted_from_outside_named_and_cost_one_timeout_together() -> None:
    halted: list[str] = []
    let_go = threading.Event()
    stuck = [
        TickerFactory(lambda loop: let_go.wait(10), f"stuck{i}", halt=lambda loop: halted.append(loop.name))
        for i in range(4)
    ]
    node = node_of(*stuck, TimeoutLoopFactory(seconds=0.05))
    took_s = run_s(node)
    let_go.set()
    assert halted == ["stuck0", "stuck1", "stuck2", "stuck3"]
    assert took_s < 0.05 + JOIN_TIMEOUT_S + 0.3
    assert [note for note in node.notes if "stuck2" in note] == [
        f"Loop 'stuck2' did not end within {JOIN_TIMEOUT_S} s: something in its loop() blocks."
    ]


def boom(component: Any) -> None:
    raise ValueError("the wire is loose")


@pytest.mark.parametrize("step", ["setup", "loop", "halt", "terminate"])
def test_a_loop_that_fails_on_its_thread_ends_the_node_with_its_error(step: str) -> None:
    log: list[str] = []
    other = PartFactory(name="other", halt=lambda part: log.append("halt"), terminate=lambda part: log.append("end"))
    node = node_of(TickerFactory(**{"name": "culprit", step: boom}), other, TimeoutLoopFactory(seconds=0.05))
    with pytest.raises(ComponentFailed) as caught:
        node.loop()
    assert "the wire is loose" in str(caught.value)
    assert "component 'culprit'" in str(caught.value)
    assert 'raise ValueError("the wire is loose")' in str(caught.value).split("\n")[0]
    assert log == ["halt", "end"]


@pytest.mark.parametrize("step", ["setup", "loop"])
def test_a_loop_that_fails_is_halted_and_terminated_itself(step: str) -> None:
    log: list[str] = []
    steps: dict[str, Any] = {
        step: boom,
        "halt": lambda loop: log.append("halt"),
        "terminate": lambda loop: log.append("terminate"),
    }
    with pytest.raises(ComponentFailed):
        node_of(TickerFactory(**steps)).loop()
    assert log == ["halt", "terminate"]


def test_setup_loop_and_halt_run_on_the_loops_thread_and_handlers_on_the_nodes() -> None:
    where: dict[str, set[int]] = {}

    def here(step: str) -> Any:
        return lambda *args: where.setdefault(step, set()).add(threading.get_ident())

    loops = [
        TickerFactory(
            lambda loop: (here("loop")(), loop.schedule(tasks.event("x"))),
            f"loop{i}",
            200,
            setup=here("setup"),
            halt=here("halt"),
        )
        for i in range(2)
    ]
    listener = PartFactory({TaskType.event: here("handler")})
    run_s(node_of(*loops, listener, TimeoutLoopFactory(seconds=0.1)))
    main = threading.get_ident()
    assert where["handler"] == {main}
    assert where["setup"] == where["loop"] == where["halt"]
    assert main not in where["loop"]
    assert len(where["loop"]) == 2


def test_a_loop_can_stop_itself() -> None:
    ticks: list[None] = []

    def once(loop: Any) -> None:
        ticks.append(None)
        loop.stop()

    node = node_of(TickerFactory(once, rate_hz=1000), TimeoutLoopFactory(seconds=0.05))
    node.loop()
    assert len(ticks) == 1
    assert node.components["ticker"].is_terminated()  # type: ignore[attr-defined]


@pytest.mark.parametrize("rate_hz", [-1.0, float("nan"), float("inf")])
def test_a_rate_that_is_none_is_refused_when_the_loop_is_made(rate_hz: float) -> None:
    with pytest.raises(ParameterError, match="'ticker' has max_tick_rate_hz="):
        node_of(TickerFactory(rate_hz=rate_hz))


def test_many_threads_at_one_door_lose_nothing_and_keep_their_own_order() -> None:
    came: dict[str, list[int]] = {f"t{i}": [] for i in range(8)}
    per_thread = 2000

    def take(task: Task, task_id: Any) -> SomeTasks:
        came[task.name].append(task.val_list[0])
        return tasks.terminate("all") if sum(map(len, came.values())) == 8 * per_thread else None

    node = node_of(PartFactory({TaskType.event: take}))

    def bring(name: str) -> None:
        for i in range(per_thread):
            node.schedule(tasks.event(name, [i]), name)

    threads = [threading.Thread(target=bring, args=(name,)) for name in came]
    for thread in threads:
        thread.start()
    node.loop()
    assert all(numbers == list(range(per_thread)) for numbers in came.values())


def test_a_door_wakes_who_waits_and_never_sleeps_over_what_is_there() -> None:
    door = Door()
    taken = 0

    def bring() -> None:
        for i in range(5000):
            door.put(tasks.event("x"), "t")
            if i % 100 == 0:
                time.sleep(0.0002)  # so that the other side falls asleep in between

    thread = threading.Thread(target=bring)
    thread.start()
    start_s = time.monotonic()
    while taken < 5000:
        door.wait(30.0)  # may also return with nothing there; only sleeping over something would be wrong
        while door.waiting:
            door.waiting.popleft()
            taken += 1
    thread.join()
    assert time.monotonic() - start_s < 10.0


def test_pages_of_a_loop_carry_the_nodes_name_and_time() -> None:
    node = node_of(TickerFactory(lambda loop: loop.store_data("x", 1)), TimeoutLoopFactory(seconds=0.05))
    node.loop()
    page = node.get_page("x")
    assert page is not None
    assert page.origin == "r_node"
    assert 0.0 < page.created_at_s < 0.5


def test_setting_the_computers_clock_does_not_move_node_time(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = WallClock()
    before_s = clock.now_s()
    monkeypatch.setattr(time, "time", lambda: 0.0)
    assert clock.now_s() >= before_s
    clock.sleep_until(clock.now_s() - 5.0)  # has passed: returns at once
