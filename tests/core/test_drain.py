"""Tasks that an ending node still executes, and its limit."""

from __future__ import annotations

from itertools import count

import pytest

from snr_sim import Config, Endpoint, EndpointFactory, Node, SimClock, Task, TaskType, WallClock, tasks
from snr_sim.core.machine import DRAIN_GENERATIONS, MAX_DRAIN_S
from snr_sim.testing.function_components import FunctionEndpointFactory


class CounterFactory(EndpointFactory):
    def __init__(self, asks_again: bool) -> None:
        super().__init__()
        self.asks_again = asks_again
        self.calls = 0

    def get(self, parent: Node) -> Endpoint:
        return Counter(self, parent, "counter")


class Counter(Endpoint):
    factory: CounterFactory

    def __init__(self, factory: CounterFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.event, "count"): self.on_count}

    def on_count(self, task: object, task_id: object) -> object:
        self.factory.calls += 1
        return tasks.event("count") if self.factory.asks_again else None


class TickingClock:
    """A wall clock that advances by a tenth of a second at each reading."""

    def __init__(self) -> None:
        self._ticks = count()

    def now_s(self) -> float:
        return next(self._ticks) * 0.1

    def sleep_until(self, time_s: float) -> None:
        pass


def test_self_scheduling_task_stops_after_ten_generations() -> None:
    factory = CounterFactory(asks_again=True)
    node = Node("test", Config(factories={"test": [factory]}))
    node.schedule([tasks.event("count"), tasks.terminate("done")])
    node.loop()
    assert factory.calls == DRAIN_GENERATIONS
    assert any("1 tasks undone" in note for note in node.notes)


def test_a_long_queue_on_the_wall_clock_does_not_hold_up_the_end() -> None:
    factory = CounterFactory(asks_again=False)
    node = Node("test", Config(factories={"test": [factory]}), clock=TickingClock())
    node.schedule([*[tasks.event("count")] * 1000, tasks.terminate("done")])
    node.loop()
    assert 1 <= factory.calls <= MAX_DRAIN_S / 0.1 + 2
    assert any("tasks undone" in note for note in node.notes)


@pytest.mark.parametrize("clock", [SimClock, WallClock, TickingClock])
def test_finish_executes_queued_tasks_and_their_results(clock: type) -> None:
    """One is asked for ten times, each asks for another, and that for a third; then comes what is to end the node."""
    done: list[int] = []

    def step(task: Task, task_id: object) -> Task | None:
        generation = task.val_list[0]
        done.append(generation)
        return tasks.event("step", [generation + 1]) if generation < 3 else None

    first = [tasks.event("step", [1])] * 10
    part = FunctionEndpointFactory(
        {(TaskType.event, "step"): step}, begin=lambda it: it.schedule([*first, tasks.finish("enough")])
    )
    node = Node("r", Config(factories={"r": [part]}), clock=clock())
    node.loop()
    assert done == [1] * 10 + [2] * 10 + [3] * 10
    assert (node.exit_reason, node.notes) == ("enough", [])
