"""Tasks that schedule each other endlessly at one time end the run with a message that names them."""

from collections import deque
from pathlib import Path
from typing import Any

import pytest

from snr_sim import (
    Config,
    MemoryLink,
    Node,
    SimClock,
    SimRunner,
    SocketsPair,
    Task,
    TaskType,
    TestRunner,
    ZenohNet,
    tasks,
)
from snr_sim.core.config import MAX_TASKS_PER_MOMENT
from snr_sim.core.machine import BURST_TASKS
from snr_sim.core.runaway import cycle_of
from snr_sim.links.faults import MIN_TRANSIT_S
from snr_sim.prelude.errors import ComponentFailedError, ConfigError
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import ErrorRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.testing.function_components import FunctionEndpoint, FunctionEndpointFactory, FunctionLoopFactory

BOUND = 1000


def echo(key: str, answer: str, name: str) -> FunctionEndpointFactory:
    """A part that answers each page of a key with one of another."""
    parts: list[FunctionEndpoint] = []

    def reply(task: Task, task_id: Any) -> Task:
        return parts[0].store_data_task(answer, 1)

    return FunctionEndpointFactory({(TaskType.process_data, key): reply}, name, begin=parts.append)


def once(key: str) -> FunctionLoopFactory:
    return FunctionLoopFactory(lambda loop: loop.store_data(key, 0), "starter", 0.001)


def config(roles: dict[str, list[Any]], at_most: int = BOUND) -> Config:
    return Config(factories=roles, max_tasks_per_moment=at_most)


def failure_of(run: Any) -> str:
    with pytest.raises(ComponentFailedError) as caught:
        run()
    return str(caught.value)


def test_a_controller_that_answers_its_own_page_is_named_with_its_tasks() -> None:
    message = failure_of(TestRunner(config({"test": [once("thrust"), echo("thrust", "thrust", "pilot")]})).run)
    assert f"'test_node' has executed {BOUND} tasks at t = 0.000 s" in message
    assert "[test_node] process_data 'thrust' -> pilot.reply" in message
    assert "[test_node] store_page 'thrust'" in message
    assert message.count("[test_node]") == 2


def links_between(kind: str) -> tuple[list[Any], list[Any], list[Any]]:
    """Links in both directions without latency: factories for a, for b, and links of the runner."""
    if kind == "memory":
        return [], [], [MemoryLink(["ping"], "a", "b"), MemoryLink(["pong"], "b", "a")]
    if kind == "sockets":
        pair = SocketsPair(("127.0.0.1", 0), name="t")
        return [pair.client(["ping"])], [pair.server(["pong"])], []
    net = ZenohNet(name="t", listen="tcp/127.0.0.1:7447")
    return [net.link(["ping"])], [net.link(["pong"])], []


@pytest.mark.parametrize("kind", ["memory", "sockets", "net"])
def test_two_nodes_that_answer_each_other_without_latency_move_on_in_time(kind: str) -> None:
    of_a, of_b, links = links_between(kind)
    begins = FunctionLoopFactory(lambda loop: loop.store_data("ping", 0), "starter", 0.001)
    roles = {"a": [echo("pong", "ping", "a_part"), *of_a, begins], "b": [echo("ping", "pong", "b_part"), *of_b]}
    runner = SimRunner(config(roles, 100), links=links, until_s=0.02)
    runner.run()
    assert runner.clock.now_s() == pytest.approx(0.02, abs=MIN_TRANSIT_S)
    pages = runner.nodes["b"].datastore.stored
    assert pytest.approx(pages / 2, rel=0.05) == 0.02 / (2 * MIN_TRANSIT_S)  # each ping and each pong is stored in b


@pytest.mark.parametrize("does", ["stores", "stores nothing"])
def test_a_loop_that_wants_each_tick_at_once_is_named(does: str) -> None:
    def tick(loop: Any) -> None:
        loop.next_tick_at_s = 0.0
        if does == "stores":
            loop.store_data("x", 1)

    message = failure_of(TestRunner(config({"test": [FunctionLoopFactory(tick, "eager", 10.0)]})).run)
    assert "time stands still" in message
    assert ("next_tick_at_s was 0" in message) == (does == "stores nothing")
    assert ("loop 'eager', whose next_tick_at_s is not later" in message) == (does == "stores")
    if does == "stores nothing":
        assert "component 'eager' at t = 0.000 s" in message
        assert f"After each of {BOUND} ticks in a row" in message


@pytest.mark.parametrize("runner", ["node", "test", "sim"])
def test_every_runner_in_lock_step_has_the_bound(runner: str) -> None:
    factories = [once("x"), echo("x", "x", "echo")]
    runs: dict[str, Any] = {
        "node": lambda: Node("test", config({"test": factories}), clock=SimClock()).loop(),
        "test": lambda: TestRunner(config({"test": factories})).run(),
        "sim": lambda: SimRunner(config({"test": factories})).run(),
    }
    assert "tasks schedule each other without end" in failure_of(runs[runner])


def test_runaway_halts_all_components_and_drops_tasks() -> None:
    log: list[str] = []

    def double(task: Task, task_id: Any) -> list[Task]:
        return [tasks.event("split"), tasks.event("split")]

    part = FunctionEndpointFactory(
        {(TaskType.event, "split"): double},
        "amoeba",
        begin=lambda part: part.schedule(tasks.event("split")),
        halt=lambda part: log.append("halted"),
    )
    message = failure_of(TestRunner(config({"test": [part]})).run)
    assert "event 'split' -> amoeba.double" in message
    assert log == ["halted"]


def count_to(limit: int, seen: list[int]) -> FunctionEndpointFactory:
    def count(task: Task, task_id: Any) -> Task | None:
        (number,) = task.val_list
        seen.append(number)
        return tasks.event("count", [number + 1]) if number < limit else None

    def begin(part: FunctionEndpoint) -> None:
        part.schedule(tasks.event("count", [1]))

    return FunctionEndpointFactory({(TaskType.event, "count"): count}, "counter", begin=begin)


def test_task_count_at_limit_does_not_raise() -> None:
    seen: list[int] = []
    TestRunner(config({"test": [count_to(BOUND, seen)]})).run()
    assert seen[-1] == BOUND
    assert "tasks schedule" in failure_of(TestRunner(config({"test": [count_to(BOUND + 1, seen)]})).run)


def test_each_moment_has_the_whole_bound_and_each_node_its_own() -> None:
    seen: list[float] = []

    def burst(loop: Any) -> None:
        loop.schedule([tasks.event("work")] * (BOUND - 1))

    worker = FunctionEndpointFactory({(TaskType.event, "work"): lambda task, task_id: seen.append(0.0)}, "worker")
    roles: dict[str, list[Any]] = {role: [FunctionLoopFactory(burst, "loop", 10.0), worker] for role in ("a", "b")}
    SimRunner(config(roles), until_s=0.5).run()
    assert len(seen) == 2 * 6 * (BOUND - 1)


def test_input_that_arrives_while_inputs_are_accepted_waits_for_the_next_time() -> None:
    class Refilled(deque[Any]):
        left = 1000

        def popleft(self) -> Any:
            self.left -= 1
            if self.left:
                self.append((tasks.event("more"), "thread"))
            return super().popleft()

    node = Node("r", config({"r": []}), clock=SimClock())
    node.inbox.waiting = Refilled([(tasks.event("more"), "thread")] * 3)
    node.machine.accept_inputs()
    assert (node.machine.queue_length, len(node.inbox.waiting)) == (3, 3)


@pytest.mark.parametrize("count", [BURST_TASKS, BURST_TASKS + 1])
def test_component_that_brings_more_inputs_than_the_bound_is_named(count: int) -> None:
    def bring(task: Task, task_id: Any) -> None:
        if not brought:
            brought.append(count)
            parts[0].parent.enqueue_input([Task(TaskType.event, "flood")] * count, "part")

    parts: list[FunctionEndpoint] = []
    brought: list[int] = []
    part = FunctionEndpointFactory(
        {(TaskType.event, "go"): bring, (TaskType.event, "flood"): bring}, "part", begin=parts.append
    )
    start = FunctionLoopFactory(lambda loop: loop.schedule(tasks.event("go")), "starter", 0.001)
    run = TestRunner(config({"test": [part, start]}, BURST_TASKS + 1 if count == BURST_TASKS else BURST_TASKS)).run
    if count == BURST_TASKS:
        run()
        return
    message = failure_of(run)
    assert f"'part' has brought {count} tasks to node 'test_node' at t = 0.000 s" in message
    assert "event 'flood'" in message


def test_on_the_wall_clock_tasks_do_not_end_the_run() -> None:
    seen: list[int] = []
    node = Node("r", config({"r": [count_to(3 * BOUND, seen), ender()]}))
    node.loop()
    assert len(seen) == 3 * BOUND


def ender() -> FunctionEndpointFactory:
    def end(task: Task, task_id: Any) -> Task | None:
        return tasks.terminate("done") if task.val_list == [3 * BOUND] else None

    return FunctionEndpointFactory({(TaskType.event, "count"): end}, "ender")


@pytest.mark.slow
def test_its_trace_is_whole_and_small_and_replays(tmp_path: Path) -> None:
    roles: dict[str, list[Any]] = {"test": [echo("thrust", "thrust", "pilot"), once("thrust")]}
    whole = config(roles, MAX_TASKS_PER_MOMENT)
    writer = TraceWriter(tmp_path / FILE_NAME, program_header(["test"], whole, __file__, SimClock()))
    message = failure_of(SimRunner(whole, recorder=writer).run)
    writer.close()
    assert (tmp_path / FILE_NAME).stat().st_size < 25e6
    trace = read_trace(tmp_path / FILE_NAME)
    assert [one.message for one in trace.records if isinstance(one, ErrorRecord)] == [message]
    replayed = replay_node(trace, "test", whole)
    assert replayed.is_identical, replayed.divergences[0]
    assert replayed.executed > MAX_TASKS_PER_MOMENT


@pytest.mark.parametrize("at_most", [0, -1, 1.5, True, "many", None])
def test_invalid_task_limit_raises_config_error(at_most: Any) -> None:
    with pytest.raises(ConfigError, match="max_tasks_per_moment"):
        config({"test": []}, at_most)


def test_the_cycle_is_the_shortest_that_comes_twice() -> None:
    steps: list[Any] = list("xyabcabcabc")
    assert cycle_of(steps) == list("abc")
    assert cycle_of(list("abcdefghijklmnopq"))[-1] == "q"  # type: ignore[arg-type]
