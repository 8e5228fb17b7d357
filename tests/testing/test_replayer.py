"""The list replayer brings every value once, in order, and all of them are handled before it ends the run."""

from typing import Any

import pytest

from snr_sim import Config, ListReplayerFactory, Node, SimClock, Task, TaskType, TimeoutLoopFactory, WallClock
from snr_sim.testing.parts import Part, PartFactory


class CollectorFactory(PartFactory):
    def __init__(self, into: list[Any]) -> None:
        super().__init__(name="collector")
        self.into = into

    def get(self, parent: Node) -> Part:
        part = super().get(parent)
        part.task_handlers = {(TaskType.store_page, "x"): self.collect}
        return part

    def collect(self, task: Task, task_id: Any) -> None:
        self.into.append((task.val_list[0].created_at_s, task.val_list[0].data))


@pytest.mark.parametrize("clock", [SimClock, WallClock])
@pytest.mark.parametrize("values", [[], [1.5], list(range(10))])
def test_all_values_are_handled_in_order_before_the_end(values: list[Any], clock: type) -> None:
    into: list[Any] = []
    replayer = ListReplayerFactory(values, "x", exit_when_done=True, rate_hz=500)
    node = Node("r", Config(factories={"r": [CollectorFactory(into), replayer]}), clock=clock())
    node.loop()
    assert [value for _, value in into] == values
    assert node.exit_reason == "list replayed"


def test_a_value_comes_at_each_tick_and_then_no_more() -> None:
    into: list[Any] = []
    factories = [CollectorFactory(into), ListReplayerFactory("abc", "x", rate_hz=10), TimeoutLoopFactory(seconds=5)]
    node = Node("r", Config(factories={"r": factories}), clock=SimClock())
    node.loop()
    assert into == [(0.0, "a"), (0.1, "b"), (0.2, "c")]
    assert node.exit_reason == "timeout"


def test_a_generator_is_read_once_and_one_factory_can_serve_two_nodes() -> None:
    factory = ListReplayerFactory((x * x for x in range(3)), "x")
    for _ in range(2):
        into: list[Any] = []
        Node("r", Config(factories={"r": [CollectorFactory(into), factory]}), clock=SimClock()).loop()
        assert [value for _, value in into] == [0, 1, 4]
