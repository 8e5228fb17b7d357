"""Listings A.1 to A.3: a moving average as an endpoint, its factory, and its tests with an expector.

What was wrong. A.1 returns `tasks.store_page(page)`, which the code that belongs to the thesis no longer had. A.2 calls
its last argument `length` where the code wants `filter_length`. A.3 names an `ExpecterEndpointFactory` and a
"ListReplayerLoop" that never existed; with the names mended it passed.

What we changed. Nothing but the names; `tasks.store_page` and `self.store_data_task` both work. A node ends after all
that was brought has been processed, so the last average is there, too (the 2021 node dropped what was queued), and
nothing sleeps. The library has all this as `MovingAvgFilterFactory`; here it is written out, as in the thesis.
"""

from collections import deque
from typing import Any

from snr_sim import (
    Endpoint,
    EndpointFactory,
    ExpectorEndpointFactory,
    ListReplayerFactory,
    MovingAvgFilter,
    MovingAvgFilterFactory,
    Node,
    SNRTestCase,
    SomeTasks,
    Task,
    TaskId,
    TaskType,
    tasks,
)


class MovingAverage(Endpoint):
    """A.1: answers each page of one key with a page of another."""

    factory: "MovingAverageFactory"

    def __init__(self, factory: "MovingAverageFactory", parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.filter = MovingAvgFilter(deque(maxlen=factory.length))
        self.task_handlers = {(TaskType.process_data, factory.input_key): self.process}

    def begin(self) -> None: ...

    def process(self, task: Task, task_id: TaskId) -> SomeTasks:
        mean = self.filter.update(self.get_data(self.factory.input_key))
        return tasks.store_page(self.page(self.factory.output_key, mean))

    def halt(self) -> None: ...

    def terminate(self) -> None: ...


class MovingAverageFactory(EndpointFactory):
    """A.2: keeps what the endpoint is to do."""

    def __init__(self, input_key: str, output_key: str, length: int) -> None:
        super().__init__()
        self.input_key = input_key
        self.output_key = output_key
        self.length = length

    def get(self, parent: Node) -> Endpoint:
        return MovingAverage(self, parent, "moving_average")


class TestMovingAverage(SNRTestCase):
    """A.3: values in, averages out."""

    def run_filter(self, values: list[Any], length: int) -> Node:
        expected = {
            (TaskType.store_page, "raw"): len(values),
            (TaskType.process_data, "raw"): len(values),
            (TaskType.store_page, "smooth"): len(values),
            (TaskType.process_data, "smooth"): len(values),
        }
        with self.expector(expected) as expector:
            return self.run_test_node(
                [
                    MovingAverageFactory("raw", "smooth", length),
                    ListReplayerFactory(values, "raw", exit_when_done=True),
                    ExpectorEndpointFactory(expector),
                ]
            )

    def test_each_value_is_answered_with_the_mean_of_the_last_ones(self) -> None:
        node = self.run_filter([1.0, 2.0, 3.0, 7.0], 2)
        self.assertPage(node.get_page("smooth"), "smooth", 5.0, origin="test_node")
        self.assertPage(node.get_page("smooth_prev"), "smooth", 2.5)

    def test_each_page_is_averaged_before_the_next_one_comes(self) -> None:
        per_value = [(kind, key) for key in ("raw", "smooth") for kind in (TaskType.store_page, TaskType.process_data)]
        with self.ordered_expector(per_value * 3) as expector:
            self.run_test_node(
                [
                    MovingAverageFactory("raw", "smooth", 2),
                    ListReplayerFactory([1, 2, 3], "raw", exit_when_done=True),
                    ExpectorEndpointFactory(expector),
                ]
            )

    def test_the_librarys_own_filter_gives_the_same(self) -> None:
        values = [0.3, -4.0, 1e3, 2.0, 2.0]
        ours = self.run_filter(values, 3).get_data("smooth")
        own = MovingAvgFilterFactory("raw", "smooth", filter_length=3, endpoint_name="own")
        node = self.run_test_node([own, ListReplayerFactory(values, "raw")])
        assert node.get_data("smooth") == ours
