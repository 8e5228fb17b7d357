"""The mean of the last values, for all supported shapes."""

from collections import deque
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import (
    ExpectorEndpointFactory,
    ListReplayerFactory,
    MovingAvgFilter,
    MovingAvgFilterFactory,
    SNRTestCase,
    TaskType,
)
from snr_sim.prelude.errors import ComponentFailedError, ParameterError


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=60), st.integers(1, 10))
def test_each_value_becomes_the_mean_of_the_last_ones(values: list[float], length: int) -> None:
    smooth = MovingAvgFilter(length)
    for i, value in enumerate(values):
        window = values[max(0, i + 1 - length) : i + 1]
        assert smooth.update(value) == pytest.approx(sum(window) / len(window), abs=1e-6)


def test_large_value_leaves_no_rounding_error_behind() -> None:
    smooth = MovingAvgFilter(2)
    for value in (1e16, 0.1, 0.3):
        mean = smooth.update(value)
    assert mean == 0.2


def test_the_mean_is_asked_for_as_the_thesis_does() -> None:
    smooth = MovingAvgFilter(deque(maxlen=3))
    assert [(smooth.update(value), smooth.avg())[1] for value in (0.0, 1.0, 2.0, 4.0)] == [0.0, 0.5, 1.0, 7.0 / 3]


def test_lists_and_dicts_are_averaged_part_by_part() -> None:
    smooth = MovingAvgFilter(deque(maxlen=2))
    assert smooth.update([1, 2.0]) == [1.0, 2.0]
    assert smooth.update((3, 4.0)) == [2.0, 3.0]
    smooth = MovingAvgFilter(2)
    smooth.update({"x": 1.0, "y": 0.0})
    assert smooth.update({"y": 1.0, "x": 2.0}) == {"y": 0.5, "x": 1.5}


def test_a_window_may_begin_with_values() -> None:
    assert MovingAvgFilter(deque([1.0, 2.0], maxlen=3)).update(3.0) == 2.0
    assert MovingAvgFilter(3).mean() is None


@pytest.mark.parametrize("window", [0, -1, 2.5, "3", deque()])
def test_a_window_has_a_length(window: Any) -> None:
    with pytest.raises(ParameterError):
        MovingAvgFilter(window)


@pytest.mark.parametrize("value", ["fast", None, True, [1, "a"], {"x": None}, [[1.0]]])
def test_non_number_is_rejected_and_named(value: Any) -> None:
    with pytest.raises(ParameterError, match="is not a number"):
        MovingAvgFilter(3).update(value)


@pytest.mark.parametrize(
    ("first", "second"), [(1.0, [1.0]), ([1.0], [1.0, 2.0]), ({"x": 1}, {"y": 1}), ({"x": 1}, [1])]
)
def test_the_shape_may_not_change(first: Any, second: Any) -> None:
    smooth = MovingAvgFilter(3)
    smooth.update(first)
    with pytest.raises(ParameterError, match="got"):
        smooth.update(second)
    assert smooth.update(first) == first if not isinstance(first, float) else 1.0  # the window is as it was


class InANode(SNRTestCase):
    def test_pages_of_one_key_become_pages_of_another(self) -> None:
        with self.expector({(TaskType.process_data, "smooth"): 4}) as expector:
            node = self.run_test_node(
                [
                    ListReplayerFactory([1.0, 2.0, 3.0, 7.0], "raw"),
                    MovingAvgFilterFactory("raw", "smooth", 2),
                    ExpectorEndpointFactory(expector),
                ]
            )
        self.assertPage(node.get_page("smooth"), "smooth", 5.0, origin="test_node")
        self.assertPage(node.get_page("smooth_prev"), "smooth", 2.5)

    def test_two_filters_need_two_names_and_windows(self) -> None:
        node = self.run_test_node(
            [
                ListReplayerFactory([0.0, 3.0], "raw"),
                MovingAvgFilterFactory("raw", "short", 1),
                MovingAvgFilterFactory("raw", "long", 2, endpoint_name="long_filter"),
            ]
        )
        assert (node.get_data("short"), node.get_data("long")) == (3.0, 1.5)

    def test_non_number_page_stops_run_and_names_filter(self) -> None:
        with pytest.raises(ComponentFailedError, match="moving_avg_filter"):
            self.run_test_node([ListReplayerFactory(["fast"], "raw"), MovingAvgFilterFactory("raw", "smooth", 2)])

    def test_equal_input_and_output_key_is_rejected(self) -> None:
        with pytest.raises(ParameterError, match="into itself"):
            MovingAvgFilterFactory("raw", "raw", 2)
