"""Listings A.1 to A.3: a moving average as an endpoint, its factory, and its tests with an expector.

What was wrong. A.1 returns `tasks.store_page(page)`, which the code that belongs to the thesis no longer had. A.2 calls
its last argument `length` where the code wants `filter_length`. A.3 names an `ExpecterEndpointFactory` and a
"ListReplayerLoop" that never existed; with the names corrected it passed.

What we changed. Nothing but the import: the listings' names and calls all work, the misspelt ones too. A node ends
after all that was brought has been processed, so the last average is there, too (the 2021 node dropped what was
queued), and nothing sleeps. The library has all this as `MovingAvgFilterFactory`; here it is written out, as in the
thesis.
"""

# ruff: noqa: F403, F405 - the names come by stars, as in the listings

import sys
from collections import deque
from typing import Any

from snr_sim.core import *
from snr_sim.prelude import *
from snr_sim.std_mods import *


class MovingAverage(Endpoint):
    """A.1: answers each page of one key with a page of another."""

    def __init__(
        self,
        factory: EndpointFactory,
        parent: AbstractNode,
        name: ComponentName,
        output: DataKey,
        window: MovingAvgFilter,
    ) -> None:
        super().__init__(factory, parent, name)
        self.output = output
        self.filter = window
        self.task_handlers = {(TaskType.store_page, factory.input_key): self.process}

    def begin(self) -> None: ...

    def process(self, task: Task, key: TaskId) -> SomeTasks:
        page = task.val_list[0]
        if not isinstance(page, Page) or not isinstance(page.data, (int, float)):
            self.warn("not a number: %s", page)
            return None
        self.filter.update(page.data)
        return tasks.store_page(self.page(self.output, self.filter.avg()))

    def halt(self) -> None: ...

    def terminate(self) -> None: ...


class MovingAverageFactory(EndpointFactory):
    """A.2: keeps what the endpoint is to do."""

    def __init__(self, input_key: DataKey, output_key: DataKey, length: int) -> None:
        super().__init__([sys.modules[__name__]])
        self.input_key = input_key
        self.output_key = output_key
        self.window = deque[float](maxlen=length)

    def get(self, parent: AbstractNode) -> Endpoint:
        return MovingAverage(self, parent, "moving_average", self.output_key, MovingAvgFilter(self.window))


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
                    ExpecterEndpointFactory(expector),
                ]
            )

    def test_each_value_is_answered_with_the_mean_of_the_last_ones(self) -> None:
        node = self.run_filter([1.0, 2.0, 3.0, 7.0], 2)
        self.assertPage(node.get_page("smooth"), "smooth", 5.0, origin="test_node")
        self.assertPage(node.get_page("smooth_prev"), "smooth", 2.5)

    def test_four_values_are_averaged_before_a_timeout_of_15_ms(self) -> None:
        expected = {(TaskType.store_page, "raw"): 4, (TaskType.process_data, "smooth"): 4}
        with self.expector(expected) as expector:
            self.run_test_node(
                [
                    ListReplayerFactory([0, 1, 2, 4], "raw"),
                    MovingAverageFactory("raw", "smooth", 2),
                    ExpecterEndpointFactory(expector, exit_when_satisfied=True),
                    TimeoutLoopFactory(ms=15),
                ]
            )

    def test_non_number_is_skipped_with_warning(self) -> None:
        with self.assertLogs("snr.test_node.moving_average", "WARNING") as logs:
            node = self.run_test_node(
                [MovingAverageFactory("raw", "smooth", 2), ListReplayerFactory(["fast", 3], "raw")]
            )
        assert len(logs.output) == 1
        assert node.get_data("smooth") == 3

    def test_each_page_is_averaged_before_the_next_one_comes(self) -> None:
        per_value = [(kind, key) for key in ("raw", "smooth") for kind in (TaskType.store_page, TaskType.process_data)]
        with self.ordered_expector(per_value * 3) as expector:
            self.run_test_node(
                [
                    MovingAverageFactory("raw", "smooth", 2),
                    ListReplayerFactory([1, 2, 3], "raw", exit_when_done=True),
                    ExpecterEndpointFactory(expector),
                ]
            )

    def test_the_librarys_own_filter_gives_the_same(self) -> None:
        values = [0.3, -4.0, 1e3, 2.0, 2.0]
        ours = self.run_filter(values, 3).get_data("smooth")
        own = MovingAvgFilterFactory("raw", "smooth", filter_length=3, endpoint_name="own")
        node = self.run_test_node([own, ListReplayerFactory(values, "raw")])
        assert node.get_data("smooth") == ours
