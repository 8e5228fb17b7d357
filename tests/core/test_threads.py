"""Loops on threads of their own: rates, shutdown, failures, and the inbox that connects them to the node."""

import re
import threading
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from statistics import median
from typing import Any

import pytest

from snr_sim import Config, Loop, Node, SimRunner, SomeTasks, Task, TaskType, TimeoutLoopFactory, WallClock, tasks
from snr_sim.core.inbox import Inbox
from snr_sim.core.loop import NEVER_S
from snr_sim.core.thread_executor import JOIN_TIMEOUT_S, ThreadExecutor
from snr_sim.prelude.errors import ComponentFailedError, ParameterError
from snr_sim.testing.fake_recorder import FakeRecorder
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory


def node_of(*factories: Any) -> Node:
    return Node("r", Config(factories={"r": list(factories)}), clock=WallClock())


def run_s(node: Node) -> float:
    start_s = time.monotonic()
    node.loop()
    return time.monotonic() - start_s


# Idle. By the CPU time of its own threads: what else runs in this process and on this computer is not in it. A node
# that spins takes all of a core that it can get, and on a computer with ten others still a tenth.


def cost_of(node: Node) -> tuple[float, float]:
    """Return the CPU time of the node's thread and what it took, in seconds."""
    before_s = time.thread_time()
    took_s = run_s(node)
    return time.thread_time() - before_s, took_s


@pytest.mark.wall_clock
def test_weakness_5_an_idle_node_costs_nothing() -> None:
    to_begin_and_end_s, _ = cost_of(node_of(TimeoutLoopFactory(seconds=0.0)))
    node = node_of(FunctionEndpointFactory({TaskType.event: lambda task, task_id: None}))
    threading.Timer(0.4, lambda: node.schedule(tasks.terminate("enough"))).start()
    cost_s, took_s = cost_of(node)
    assert node.exit_reason == "enough"
    assert cost_s - to_begin_and_end_s < 0.01 * took_s


@pytest.mark.wall_clock
def test_a_node_whose_loops_wait_costs_nothing_either() -> None:
    ticks: list[tuple[float, float]] = []
    look = FunctionLoopFactory(lambda loop: ticks.append((time.thread_time(), time.monotonic())), rate_hz=5)
    to_begin_and_end_s, _ = cost_of(node_of(TimeoutLoopFactory(seconds=0.0)))
    node = node_of(TimeoutLoopFactory(seconds=0.5), look)
    cost_s, took_s = cost_of(node)
    assert node.exit_reason == "timeout"
    (before_s, from_s), (after_s, to_s) = ticks[0], ticks[-1]
    assert cost_s - to_begin_and_end_s < 0.01 * took_s
    assert after_s - before_s < 0.01 * (to_s - from_s)


@pytest.mark.wall_clock
def test_a_node_that_sleeps_is_woken_as_soon_as_a_bare_thread() -> None:
    """A node that looked every 10 ms would take half of that; a thread that waits for another takes 0.05 ms, and on a
    busy computer both take longer."""

    def took_s(wait_for: Callable[[], Any], wake: Callable[[], Any]) -> float:
        went_s: list[float] = []

        def wakes() -> None:
            went_s.append(time.monotonic())
            wake()

        threading.Timer(0.005, wakes).start()
        wait_for()
        return time.monotonic() - went_s[0]

    of_node, of_peer = [], []
    for _ in range(11):
        node, peer = node_of(), threading.Event()
        of_node.append(took_s(node.loop, lambda node=node: node.schedule(tasks.terminate("enough"))))
        of_peer.append(took_s(peer.wait, peer.set))
    assert median(of_node) < 3.0 * median(of_peer) + 0.003  # and an end takes something


# Rates. On a clock that advances only during work or waits, the deadlines are exact.

LATE_S = 0.0001  # how long after its time a thread that waits is woken


class WorkClock(WallClock):
    time_s = 0.0

    def now_s(self) -> float:
        return self.time_s


class Waits(threading.Event):
    def __init__(self, clock: WorkClock) -> None:
        super().__init__()
        self.clock = clock

    def wait(self, timeout: float | None = None) -> bool:
        assert timeout is not None
        self.clock.time_s += timeout + (LATE_S if timeout else 0.0)
        return self.is_set()


class Wakes(Waits):
    """Is woken at given times."""

    def __init__(self, clock: WorkClock, at_s: Sequence[float]) -> None:
        super().__init__(clock)
        self.at_s = at_s

    def wait(self, timeout: float | None = None) -> bool:
        assert timeout is not None
        woken_s = [at_s for at_s in self.at_s if self.clock.time_s < at_s <= self.clock.time_s + timeout]
        if not woken_s:
            return super().wait(timeout)
        self.clock.time_s = woken_s[0]
        self.set()
        return True


def ticks_of(
    rate_hz: float,
    works_s: Sequence[float],
    woken_at_s: Sequence[float] = (),
    next_ticks_at_s: Sequence[float | None] = (),
) -> tuple[list[float], ThreadExecutor]:
    """Return the tick times of a threaded loop with this work per tick, these `next_tick_at_s` and `wake` times; and
    its caller."""
    ticks: list[float] = []
    clock = WorkClock()

    def work(loop: Any) -> None:
        ticks.append(clock.time_s)
        clock.time_s += works_s[len(ticks) - 1]
        loop.next_tick_at_s = next_ticks_at_s[len(ticks) - 1] if next_ticks_at_s else None
        if len(ticks) == len(works_s):
            executor.stop()

    node = Node("r", Config(factories={"r": [FunctionLoopFactory(work, rate_hz=rate_hz)]}), clock=clock)
    executor = ThreadExecutor(node.components["ticker"], node.life)  # type: ignore[arg-type]
    executor._stopping, executor._waking = Waits(clock), Wakes(clock, woken_at_s)
    executor._run()
    return ticks, executor


@pytest.mark.parametrize("rate_hz", [50, 100, 500])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.9])
def test_weakness_26_a_loop_on_a_thread_keeps_its_rate_although_it_works(rate_hz: int, share: float) -> None:
    ticks, executor = ticks_of(rate_hz, [share / rate_hz] * 500)
    assert ticks == pytest.approx([k / rate_hz + (LATE_S if k else 0.0) for k in range(500)])
    assert executor.late_s == 0.0


def test_late_loop_skips_ticks() -> None:
    ticks, executor = ticks_of(100, [0.0, 0.0, 0.125, 0.0, 0.0, 0.0])
    assert ticks == pytest.approx([0.0, 0.0101, 0.0201, 0.1451, 0.1501, 0.1601])
    assert executor.late_s == pytest.approx(0.1151)


def test_loop_woken_once_per_period_ticks_only_at_wakes() -> None:
    woken_s = [0.007 + 0.01 * k for k in range(20)]
    ticks, executor = ticks_of(100, [0.0] * 20, woken_s)
    assert ticks == pytest.approx([0.0, *woken_s[:19]])
    assert executor.late_s == 0.0


def test_loop_woken_often_ticks_at_most_twice_per_period() -> None:
    ticks, _ = ticks_of(100, [0.001] * 40, [0.0003 * k for k in range(1, 2000)])
    assert min(later - earlier for earlier, later in pairwise(ticks)) == pytest.approx(0.005 + LATE_S)


def test_loop_no_longer_woken_keeps_its_rate() -> None:
    ticks, _ = ticks_of(100, [0.0] * 5, [0.007])
    assert ticks == pytest.approx([0.0, 0.007, 0.0221, 0.0321, 0.0421])


def test_idle_loop_sleeps_until_its_time_or_a_wake_and_then_keeps_its_rate() -> None:
    ticks, executor = ticks_of(100, [0.0] * 7, [0.9], [None, 0.505, None, None, NEVER_S, None, None])
    assert ticks == pytest.approx([0.0, 0.0101, 0.5051, 0.5152, 0.5252, 0.9, 0.9101])
    assert executor.late_s == 0.0


@pytest.mark.slow
def test_waiting_thread_is_woken_by_wake_and_by_stop() -> None:
    came = threading.Event()

    def work(loop: Any) -> None:
        loop.next_tick_at_s = 1e6
        if loop.caller is not None and loop.caller.ticks >= 2:
            came.set()

    node = node_of(FunctionLoopFactory(work, rate_hz=1000), TimeoutLoopFactory(seconds=60))
    loop: Any = node.components["ticker"]
    running = threading.Thread(target=node.loop)
    running.start()
    while not came.wait(0.001):
        loop.wake()
    node.schedule(tasks.terminate("enough"))
    running.join(60.0)
    assert not running.is_alive()
    assert loop.caller.ticks >= 2  # one more after a second `wake` that came before this check


@pytest.mark.wall_clock
def test_a_real_thread_ticks_once_a_period_and_not_a_period_after_its_work() -> None:
    """The middle of its intervals: one and a half periods if it waited a period after its work, on any computer."""
    ticks: list[float] = []

    def work(loop: Any) -> None:
        ticks.append(time.monotonic())
        time.sleep(0.02)
        if len(ticks) == 16:
            loop.schedule(tasks.terminate("enough"))

    node_of(FunctionLoopFactory(work, rate_hz=25), TimeoutLoopFactory(seconds=60)).loop()
    assert median(later - earlier for earlier, later in pairwise(ticks)) < 1.2 * 0.04


# The end


@pytest.mark.slow
def test_a_timeout_does_not_hold_up_the_end() -> None:
    stop = FunctionLoopFactory(lambda loop: loop.schedule(tasks.terminate("stop")), "stop")
    node = node_of(TimeoutLoopFactory(seconds=60), stop)
    assert run_s(node) < 0.4
    assert (node.exit_reason, node.notes) == ("stop", [])  # no loop that had to be left behind


@pytest.mark.slow
def test_weakness_17_fifty_loops_at_10_hz_end_together_and_not_one_after_the_other() -> None:
    """Each one's halt waits for all the others': in turn, they would take 25 s, and the first would have given up."""
    all_halted = threading.Event()
    together = threading.Barrier(50, action=all_halted.set, timeout=12.0)
    there: set[str] = set()

    def count(task: Task, task_id: Any) -> SomeTasks:
        there.add(task.name)
        return tasks.terminate("all there") if len(there) == 50 else None

    def arrive(loop: Any) -> None:
        loop.schedule(tasks.event(loop.name))

    slow = [FunctionLoopFactory(arrive, f"slow{i}", rate_hz=10, halt=lambda loop: together.wait()) for i in range(50)]
    node = node_of(*slow, FunctionEndpointFactory({TaskType.event: count}))
    node.loop()
    assert all_halted.wait(15.0)


@pytest.mark.wall_clock
def test_loops_that_hang_are_halted_from_outside_named_and_cost_one_timeout_together() -> None:
    halted: list[str] = []
    there: set[str] = set()
    asked_s: list[float] = []
    released = threading.Event()

    def hang(loop: Any) -> None:
        loop.schedule(tasks.event(loop.name))
        released.wait(60)

    def arrived(task: Task, task_id: Any) -> SomeTasks:
        there.add(task.name)
        asked_s.append(time.monotonic())
        return tasks.terminate("all there") if len(there) == 4 else None

    stuck = [FunctionLoopFactory(hang, f"stuck{i}", halt=lambda loop: halted.append(loop.name)) for i in range(4)]
    node = node_of(*stuck, FunctionEndpointFactory({TaskType.event: arrived}))
    node.loop()
    took_s = time.monotonic() - asked_s[-1]
    released.set()
    assert halted == ["stuck0", "stuck1", "stuck2", "stuck3"]
    assert took_s < JOIN_TIMEOUT_S + 0.3  # in turn they would take four times as long
    (note,) = [note for note in node.notes if "stuck2" in note]
    assert note.startswith(f"Loop 'stuck2' did not end within {JOIN_TIMEOUT_S} s: something in its loop() blocks (")
    assert re.search(r"test_threads\.py, line \d+: released\.wait\(60\)\)\.$", note)


class HangingServer(Loop):
    """Loop that has a thread in lock step, too, as consoles and live pages have, and does not end."""

    released = threading.Event()

    def begin(self) -> None:
        self.parent.start_loop(self, on_thread=True)

    def loop(self) -> None:
        self.released.wait(60)


@pytest.mark.slow
def test_thread_in_lock_step_changes_no_trace() -> None:
    recorder, config = FakeRecorder(), Config(factories={"r": [HangingServer.factory(name="page")]})
    runner = SimRunner(config, recorder=recorder, until_s=0.1)
    try:
        runner.run()
    finally:
        HangingServer.released.set()
    assert any("Loop 'page' did not end within" in note for note in runner.nodes["r"].notes)
    ((_, summary),) = recorder.ends
    assert summary["notes"] == []


def boom(component: Any) -> None:
    raise ValueError("the wire is loose")


@pytest.mark.slow
@pytest.mark.parametrize("step", ["setup", "loop", "halt", "terminate"])
def test_a_loop_that_fails_on_its_thread_ends_the_node_with_its_error(step: str) -> None:
    log: list[str] = []
    other = FunctionEndpointFactory(
        name="other", halt=lambda part: log.append("halt"), terminate=lambda part: log.append("end")
    )
    culprit = {"loop": lambda loop: loop.schedule(tasks.terminate("enough")), step: boom}
    node = node_of(FunctionLoopFactory(**culprit, name="culprit"), other)
    with pytest.raises(ComponentFailedError) as caught:
        node.loop()
    assert "the wire is loose" in str(caught.value)
    assert "component 'culprit'" in str(caught.value)
    assert 'raise ValueError("the wire is loose")' in str(caught.value).split("\n")[0]
    assert log == ["halt", "end"]
    assert not [note for note in node.notes if "the wire is loose" in note]  # reported only once


@pytest.mark.slow
def test_a_halt_that_is_slow_to_fail_ends_the_node_with_its_error() -> None:
    """On a machine that is busy with something else, 0.5 s may be over before the halt has raised."""

    def slow_boom(loop: Any) -> None:
        time.sleep(JOIN_TIMEOUT_S + 0.2)
        boom(loop)

    culprit = FunctionLoopFactory(lambda loop: loop.schedule(tasks.terminate("enough")), "culprit", halt=slow_boom)
    with pytest.raises(ComponentFailedError, match="the wire is loose"):
        node_of(culprit).loop()


@pytest.mark.slow
def test_a_halt_that_hangs_is_left_with_a_note() -> None:
    released = threading.Event()
    culprit = FunctionLoopFactory(
        lambda loop: loop.schedule(tasks.terminate("enough")), "culprit", halt=lambda loop: released.wait(60)
    )
    node = node_of(culprit)
    node.loop()
    released.set()
    (note,) = [note for note in node.notes if "culprit" in note]
    assert note.startswith(
        f"Loop 'culprit' did not end within {2 * JOIN_TIMEOUT_S:g} s: something in its halt() blocks ("
    )


@pytest.mark.slow
@pytest.mark.parametrize("step", ["setup", "loop"])
def test_a_loop_that_fails_is_halted_and_terminated_itself(step: str) -> None:
    log: list[str] = []
    steps: dict[str, Any] = {
        step: boom,
        "halt": lambda loop: log.append("halt"),
        "terminate": lambda loop: log.append("terminate"),
    }
    with pytest.raises(ComponentFailedError):
        node_of(FunctionLoopFactory(**steps)).loop()
    assert log == ["halt", "terminate"]


@pytest.mark.slow
def test_setup_loop_and_halt_run_on_the_loops_thread_and_handlers_on_the_nodes() -> None:
    where: dict[str, set[int]] = {}

    def here(step: str) -> Any:
        return lambda *args: where.setdefault(step, set()).add(threading.get_ident())

    loops = [
        FunctionLoopFactory(
            lambda loop: (here("loop")(), loop.schedule(tasks.event("x"))),
            f"loop{i}",
            200,
            setup=here("setup"),
            halt=here("halt"),
        )
        for i in range(2)
    ]
    came: list[Task] = []

    def handle(task: Task, task_id: Any) -> SomeTasks:
        here("handler")()
        came.append(task)
        return tasks.terminate("enough") if len(came) == 20 and len(where["loop"]) == 2 else None

    node_of(*loops, FunctionEndpointFactory({TaskType.event: handle})).loop()
    main = threading.get_ident()
    assert where["handler"] == {main}
    assert where["setup"] == where["loop"] == where["halt"]
    assert main not in where["loop"]
    assert len(where["loop"]) == 2


@pytest.mark.slow
def test_a_loop_can_stop_itself() -> None:
    ticks: list[None] = []

    def once(loop: Any) -> None:
        ticks.append(None)
        loop.stop()

    looks: list[bool] = []

    def look(loop: Any) -> None:
        looks.append(loop.parent.components["ticker"].is_terminated())
        if sum(looks) == 10:
            loop.schedule(tasks.terminate("seen"))

    node = node_of(
        FunctionLoopFactory(once, rate_hz=1000), FunctionLoopFactory(look, "look", 500), TimeoutLoopFactory(seconds=60)
    )
    node.loop()
    assert node.exit_reason == "seen"
    assert len(ticks) == 1
    assert node.components["ticker"].is_terminated()  # type: ignore[attr-defined]


@pytest.mark.parametrize("rate_hz", [-1.0, float("nan"), float("inf")])
def test_invalid_rate_raises_when_loop_is_created(rate_hz: float) -> None:
    with pytest.raises(ParameterError, match="'ticker' has max_tick_rate_hz="):
        node_of(FunctionLoopFactory(rate_hz=rate_hz))


@pytest.mark.slow
def test_inbox_keeps_order_per_thread_and_loses_nothing() -> None:
    came: dict[str, list[int]] = {f"t{i}": [] for i in range(8)}
    per_thread = 2000

    def take(task: Task, task_id: Any) -> SomeTasks:
        came[task.name].append(task.val_list[0])
        return tasks.terminate("all") if sum(map(len, came.values())) == 8 * per_thread else None

    node = node_of(FunctionEndpointFactory({TaskType.event: take}))

    def bring(name: str) -> None:
        for i in range(per_thread):
            node.schedule(tasks.event(name, [i]), name)

    threads = [threading.Thread(target=bring, args=(name,)) for name in came]
    for thread in threads:
        thread.start()
    node.loop()
    assert all(numbers == list(range(per_thread)) for numbers in came.values())


@pytest.mark.slow
def test_inbox_put_wakes_waiting_thread() -> None:
    inbox = Inbox()
    taken = 0

    def bring() -> None:
        for i in range(5000):
            inbox.put(tasks.event("x"), "t")
            if i % 100 == 0:
                time.sleep(0.0002)  # so that the other side falls asleep in between

    thread = threading.Thread(target=bring)
    thread.start()
    start_s = time.monotonic()
    while taken < 5000:
        inbox.wait(30.0)  # may also return with nothing there; only sleeping over something would be wrong
        while inbox.waiting:
            inbox.waiting.popleft()
            taken += 1
    thread.join()
    assert time.monotonic() - start_s < 10.0  # one sleep over something takes 30 s


@pytest.mark.slow
def test_pages_of_a_loop_carry_the_nodes_name_and_time() -> None:
    before_s: list[float] = []

    def store(loop: Any) -> None:
        before_s.append(loop.parent.clock.now_s())
        loop.store_data("x", 1)
        loop.schedule(tasks.terminate("stored"))
        loop.stop()

    node = node_of(FunctionLoopFactory(store))
    node.loop()
    page = node.get_page("x")
    assert page is not None
    assert page.origin == "r_node"
    assert before_s[0] <= page.created_at_s <= node.clock.now_s()


def test_setting_the_computers_clock_does_not_move_node_time(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = WallClock()
    before_s = clock.now_s()
    monkeypatch.setattr(time, "time", lambda: 0.0)
    assert clock.now_s() >= before_s
    clock.sleep_until(clock.now_s() - 5.0)  # has passed: returns at once
