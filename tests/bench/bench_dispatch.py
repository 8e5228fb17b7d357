"""Dispatch: cost of the event machine for a handler that returns the next task.

Run by `snr bench dispatch`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from harness import Benchmark, Row, compare

from snr_sim import Config, Endpoint, EndpointFactory, Mode, Node, SomeTasks, Task, TaskId, TaskType
from snr_sim.core.clocks import SimClock, WallClock
from snr_sim.prelude.clock import Clock

TICK = (TaskType.event, "tick")


class Ticker:
    """Answers each tick with the next one, a given number of times."""

    def __init__(self, count: int) -> None:
        self.left = count

    def tick(self, task: Task, task_id: TaskId) -> SomeTasks:
        self.left -= 1
        return Task(TaskType.event, "tick") if self.left else Task(TaskType.terminate, "done")


class TickerEndpoint(Endpoint):
    """The same, in a node."""

    def __init__(self, factory: EndpointFactory, parent: Node, count: int) -> None:
        super().__init__(factory, parent, "ticker")
        self.task_handlers = {TICK: Ticker(count).tick}


class Idler(Endpoint):
    """Has a handler for an event that never occurs."""

    def __init__(self, factory: EndpointFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.event, f"never_{name}"): self.never}

    def never(self, task: Task, task_id: TaskId) -> SomeTasks:
        return None


class Listener(Endpoint):
    """One of many that handle the same task."""

    def __init__(self, factory: EndpointFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {TICK: self.listen}

    def listen(self, task: Task, task_id: TaskId) -> SomeTasks:
        return None


class Make(EndpointFactory):
    """Makes whatever the function makes."""

    def __init__(self, make: Callable[[EndpointFactory, Node], Endpoint]) -> None:
        super().__init__()
        self.make = make

    def get(self, parent: Node) -> Endpoint:
        return self.make(self, parent)


def bare_loop(count: int) -> Benchmark:
    """Return the minimum dispatch: a queue, a dict, a call that returns a new task."""

    def prepare() -> Callable[[], Any]:
        handlers = {TICK: Ticker(count).tick}
        queue = deque([Task(*TICK)])

        def run() -> None:
            while True:
                task = queue.popleft()
                if task.type is TaskType.terminate:
                    return
                task_id = (task.type, task.name)
                queue.append(handlers[task_id](task, task_id))

        return run

    return prepare


def node_loop(count: int, clock: Callable[[], Clock], idlers: int = 0) -> Benchmark:
    """A node with one endpoint that reschedules itself, among others that have nothing to do."""

    def prepare() -> Callable[[], Any]:
        factories = [Make(lambda factory, parent: TickerEndpoint(factory, parent, count))]
        factories += [Make(lambda factory, parent, i=i: Idler(factory, parent, f"idler_{i}")) for i in range(idlers)]
        return ready_node(factories, clock())

    return prepare


def ready_node(factories: list[EndpointFactory], clock: Clock) -> Callable[[], Any]:
    """Return what runs a node that has begun and has one tick waiting."""
    node = Node("bench", Config(Mode.TEST, {"bench": factories}), clock=clock)
    node.begin()
    node.enqueue_input(Task(*TICK), "bench")
    return node.run_ready


def many_listeners(count: int, listeners: int) -> Benchmark:
    """A node in which every tick goes to many handlers."""

    def prepare() -> Callable[[], Any]:
        factories = [Make(lambda factory, parent: TickerEndpoint(factory, parent, count))]
        factories += [Make(lambda factory, parent, i=i: Listener(factory, parent, f"l_{i}")) for i in range(listeners)]
        return ready_node(factories, SimClock())

    return prepare


def bare_listeners(count: int, listeners: int) -> Benchmark:
    """Call as many handlers from a list."""

    def prepare() -> Callable[[], Any]:
        owner = object.__new__(Listener)
        handlers = [owner.listen] * listeners

        def run() -> None:
            for _ in range(count):
                task = Task(*TICK)
                for handler in handlers:
                    handler(task, TICK)

        return run

    return prepare


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    count, rounds = (20_000, 3) if is_quick else (100_000, 15)
    found = compare(bare_loop(count), node_loop(count, SimClock), node_loop(count, WallClock), rounds=rounds)
    bare_us, *nodes_us = (1e6 * one_s / count for one_s in found.shortest_s)
    for where, node_us, ratio in zip(("in lock step", "on the wall clock"), nodes_us, found.ratios[1:], strict=True):
        yield Row(
            f"self-rescheduling event, {where}",
            node_us,
            "us/task",
            limit=0.6,
            baseline=bare_us,
            compared_to="bare loop",
            ratio=ratio,
            ratio_limit=5.0,
        )
    found = compare(node_loop(count, SimClock), node_loop(count, SimClock, idlers=999), rounds=rounds)
    yield Row(
        "one handler among 1000 components",
        1e6 * found.shortest_s[1] / count,
        "us/task",
        baseline=1e6 * found.shortest_s[0] / count,
        compared_to="among 1",
        ratio=found.ratios[1],
        ratio_limit=1.2,
    )
    turns = count // 400
    found = compare(bare_listeners(turns, 1000), many_listeners(turns, 1000), rounds=rounds)
    yield Row(
        "1000 handlers of one task",
        1e6 * found.shortest_s[1] / turns / 1000,
        "us/call",
        limit=0.25,
        baseline=1e6 * found.shortest_s[0] / turns / 1000,
        compared_to="calls from a list",
        ratio=found.ratios[1],
    )
