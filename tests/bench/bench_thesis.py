"""The thesis' own benchmark: how many handlers are called while a node grows by one endpoint after the other.

Listing 5.2 prints 547 endpoints and 149 878 handler calls in 2 s on a Raspberry Pi 4. That is 547 x 548 / 2:
each round calls every endpoint once, and then adds one. It therefore measures two costs at once, which have separate
rows as well: the cost of a call among many components, and the cost of adding a component to many.
Run by `snr bench thesis`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from harness import Benchmark, Row, compare

from snr_sim import Config, Endpoint, EndpointFactory, Mode, Node, SomeTasks, Task, TaskId, TaskType, tasks
from snr_sim.core.clocks import WallClock

ROUND = (TaskType.event, "round")
THESIS_ENDPOINTS, THESIS_CALLS = 547, 149_878
ADD_LIMIT_US = 30.0
# The library of 2021 calls 352 000 handlers in 2 s on a computer on which this one calls as many in 0.05 s.
CALLS_PER_S = 4e6


class StressFactory(EndpointFactory):
    """Makes one of many endpoints.

    Args:
        number: of the endpoint.
        grows_to: the endpoint that is the last adds the next one, up to so many.
    """

    def __init__(self, number: int, grows_to: int = 0) -> None:
        super().__init__()
        self.number = number
        self.grows_to = grows_to

    def get(self, parent: Node) -> Endpoint:
        return Stress(self, parent, f"stress_{self.number}")


class Stress(Endpoint):
    """Is called in each round; the newest has the next one added, and asks for the next round."""

    factory: StressFactory

    def __init__(self, factory: StressFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {ROUND: self.on_round}
        self.is_newest = factory.grows_to > 0

    def on_round(self, task: Task, task_id: TaskId) -> SomeTasks:
        if not self.is_newest:
            return None
        self.is_newest = False
        following = self.factory.number + 1
        if following == self.factory.grows_to:
            return tasks.terminate("grown")
        return [tasks.add_component(StressFactory(following, self.factory.grows_to)), tasks.event("round")]


def growing_node(endpoints: int) -> Benchmark:
    """A node that grows from one endpoint to so many, one a round."""

    def prepare() -> Callable[[], Any]:
        node = _begun_node([StressFactory(0, endpoints)])
        node.enqueue_input(tasks.event("round"), "bench")
        return node.run_ready

    return prepare


def growing_list(endpoints: int) -> Benchmark:
    """The same with a list of handlers and nothing around it."""

    def prepare() -> Callable[[], Any]:
        node = _begun_node([])
        factory = StressFactory(0)

        def run() -> None:
            handlers = []
            for number in range(endpoints):
                handlers.append(Stress(factory, node, f"stress_{number}").on_round)
                task = Task(*ROUND)
                for handler in handlers:
                    handler(task, ROUND)

        return run

    return prepare


def adding_node(endpoints: int, added: int) -> Benchmark:
    """A node of so many endpoints, to which some more are added."""

    def prepare() -> Callable[[], Any]:
        node = _begun_node([StressFactory(number) for number in range(endpoints)])
        node.enqueue_input(tasks.event("round"), "bench")
        node.run_ready()
        for number in range(endpoints, endpoints + added):
            node.enqueue_input(tasks.add_component(StressFactory(number)), "bench")
        return node.run_ready

    return prepare


def _begun_node(factories: list[EndpointFactory]) -> Node:
    node = Node("stress", Config(Mode.TEST, {"stress": factories}), clock=WallClock())
    node.begin()
    return node


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    rounds = 3 if is_quick else 11
    for endpoints in (THESIS_ENDPOINTS, 1000):
        calls = endpoints * (endpoints + 1) // 2
        found = compare(growing_list(endpoints), growing_node(endpoints), rounds=rounds)
        bare_s, node_s = found.shortest_s
        yield Row(
            f"handler calls while a node grows to {endpoints} endpoints",
            calls / node_s,
            "calls/s",
            limit=CALLS_PER_S,
            more_is_better=True,
            baseline=calls / bare_s,
            compared_to="calls from a list that grows",
            ratio=found.ratios[1],
            ratio_limit=3.0,
            note=f"{calls} calls; listing 5.2: {THESIS_CALLS} in 2 s" if endpoints == THESIS_ENDPOINTS else "",
        )
    added = 100 if is_quick else 300
    found = compare(adding_node(10, added), adding_node(1000, added), rounds=rounds)
    few_us, many_us = (1e6 * one_s / added for one_s in found.shortest_s)
    yield Row(
        "add_component to a node of 1000 components",
        many_us,
        "us",
        limit=ADD_LIMIT_US,
        baseline=few_us,
        compared_to="to a node of 10",
        ratio=found.ratios[1],
        ratio_limit=2.0,
    )
