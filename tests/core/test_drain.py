"""What a node that ends still finishes, and where it stops."""

from __future__ import annotations

from itertools import count

from snr_sim import Config, Endpoint, EndpointFactory, Node, TaskType, tasks
from snr_sim.core.machine import DRAIN_GENERATIONS, DRAIN_MAX_S


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
    """A wall clock on which each look takes a tenth of a second."""

    def __init__(self) -> None:
        self._ticks = count()

    def now_s(self) -> float:
        return next(self._ticks) * 0.1

    def sleep_until(self, time_s: float) -> None:
        pass


def test_a_task_that_asks_for_itself_is_cut_off_after_ten_generations() -> None:
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
    assert 1 <= factory.calls <= DRAIN_MAX_S / 0.1 + 2
    assert any("tasks undone" in note for note in node.notes)
