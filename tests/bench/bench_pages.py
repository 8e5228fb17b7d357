"""Pages: stored, answered and read back; and to JSON and back, as a link or a trace sends them.

Run by `snr bench pages`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
from harness import Benchmark, Row, compare

from snr_sim import Config, Endpoint, EndpointFactory, Mode, Node, Page, SomeTasks, Task, TaskId, TaskType
from snr_sim.core.clocks import SimClock

COUNT_TASK = (TaskType.process_data, "count")
PAGE = Page(
    "inertial",
    {
        "x_m": 12.345678901,
        "z_m": 140.25,
        "vx_mps": -3.0625,
        "vz_mps": -7.1234,
        "attitude_rad": 0.012345,
        "rate_radps": -0.00098,
    },
    "lander_node",
    26.5,
)


class Counter(Endpoint):
    """Reads a page, adds one, stores it: one round."""

    def __init__(self, factory: EndpointFactory, parent: Node, rounds: int) -> None:
        super().__init__(factory, parent, "counter")
        self.rounds = rounds
        self.task_handlers = {COUNT_TASK: self.on_count}

    def on_count(self, task: Task, task_id: TaskId) -> SomeTasks:
        count = self.get_data("count") + 1
        if count == self.rounds:
            return Task(TaskType.terminate, "done")
        return self.store_data_task("count", count)


class CounterFactory(EndpointFactory):
    """Makes it."""

    def __init__(self, rounds: int) -> None:
        super().__init__()
        self.rounds = rounds

    def get(self, parent: Node) -> Endpoint:
        return Counter(self, parent, self.rounds)


def node_rounds(count: int) -> Benchmark:
    """Rounds of store_data, handler and get_data in a node."""

    def prepare() -> Callable[[], Any]:
        node = Node("bench", Config(Mode.TEST, {"bench": [CounterFactory(count)]}), clock=SimClock())
        node.begin()
        node.store_data("count", 0)
        return node.run_ready

    return prepare


def bare_rounds(count: int) -> Benchmark:
    """The same page and the same two tasks through a queue and two dicts."""

    def prepare() -> Callable[[], Any]:
        pages: dict[str, Page] = {}
        queue = deque([store_task(0)])

        def store(task: Task, task_id: TaskId) -> Task:
            page = task.val_list[0]
            pages[page.key] = page
            return Task(TaskType.process_data, page.key)

        def on_count(task: Task, task_id: TaskId) -> Task:
            return store_task(pages["count"].data + 1)

        handlers = {(TaskType.store_page, "count"): store, COUNT_TASK: on_count}

        def run() -> None:
            for _ in range(2 * count):
                task = queue.popleft()
                task_id = (task.type, task.name)
                queue.append(handlers[task_id](task, task_id))

        return run

    return prepare


def store_task(count: int) -> Task:
    """Return the task that stores the count."""
    return Task(TaskType.store_page, "count", [Page("count", count, "bench_node", 0.0)])


def kit_json(count: int) -> Benchmark:
    """A page through `serialize` and `deserialize`."""
    assert Page.deserialize(PAGE.serialize()) == PAGE

    def run() -> None:
        for _ in range(count):
            Page.deserialize(PAGE.serialize())

    return lambda: run


def bare_json(count: int) -> Benchmark:
    """The same page through msgspec alone, which does not notice what JSON would change."""
    encode, decode = msgspec.json.Encoder().encode, msgspec.json.Decoder(Page).decode

    def run() -> None:
        for _ in range(count):
            decode(encode(PAGE))

    return lambda: run


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    count, rounds = (10_000, 3) if is_quick else (50_000, 15)
    found = compare(bare_rounds(count), node_rounds(count), rounds=rounds)
    yield Row(
        "store_data, handler, get_data",
        1e6 * found.shortest_s[1] / count,
        "us/round",
        limit=2.5,
        baseline=1e6 * found.shortest_s[0] / count,
        compared_to="bare loop and dict",
        ratio=found.ratios[1],
    )
    found = compare(bare_json(count), kit_json(count), rounds=rounds)
    yield Row(
        f"page to JSON and back, {len(PAGE.serialize())} bytes",
        1e6 * found.shortest_s[1] / count,
        "us",
        limit=2.0,
        baseline=1e6 * found.shortest_s[0] / count,
        compared_to="bare msgspec",
        ratio=found.ratios[1],
    )
