"""Moving average: the mean of the newest value and the ones just before it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey, SomeTasks, Task, TaskId, TaskType

# A number, a list of numbers, or a flat dict of numbers. The shape may not change within a window.
Sample: TypeAlias = float | Sequence[float] | Mapping[str, float]


class MovingAvgFilter:
    """Mean of the last values; of all values until the window is full.

    Args:
        window: number of values, or a deque with that `maxlen`, which may contain initial values.

    >>> smooth = MovingAvgFilter(2)
    >>> [smooth.update(x) for x in (1.0, 2.0, 4.0)]
    [1.0, 1.5, 3.0]
    >>> MovingAvgFilter(2).update({"x": 1.0, "y": 2.0})
    {'x': 1.0, 'y': 2.0}
    """

    def __init__(self, window: deque[Any] | int) -> None:
        values: deque[Any] = window if isinstance(window, deque) else deque(maxlen=_checked_length(window))
        if not values.maxlen:
            raise ParameterError("This window has no length, so it would never forget.", fix="deque(maxlen=10).")
        self._values = values

    def update(self, value: Sample) -> Any:
        """Add a value and return the mean, in the shape of the value.

        Raises:
            ParameterError: the value does not consist of numbers, or its shape differs from those before.
        """
        shape = _shape(value)
        if self._values and _shape(self._values[-1]) != shape:
            raise ParameterError(
                f"A moving average of values like {self._values[-1]!r} got {value!r}.", fix="one filter for each shape."
            )
        self._values.append(value)
        return self.mean()

    def mean(self) -> Any:
        """Return the mean of the values in the window, or None if it is empty."""
        if not self._values:
            return None
        newest = self._values[-1]
        if isinstance(newest, Mapping):
            return {key: self._mean_of([value[key] for value in self._values]) for key in newest}
        if isinstance(newest, Sequence):
            return [self._mean_of(column) for column in zip(*self._values, strict=True)]
        return self._mean_of(self._values)

    avg = mean  # the thesis' name

    def _mean_of(self, numbers: Sequence[float] | deque[float]) -> float:
        # Summed exactly at each call: a running sum would accumulate the rounding errors of all past values.
        return math.fsum(numbers) / len(numbers)


def _checked_length(length: int) -> int:
    if not isinstance(length, int) or length < 1:
        raise ParameterError(f"A moving average over {length!r} values.", fix="a whole number from 1 up.")
    return length


def _shape(value: Any) -> tuple[str, object]:
    """Return what must be equal within a window: the length of a list, the keys of a dict; nothing for a number."""
    parts: list[Any] = [value]
    shape: tuple[str, object] = ("number", None)
    if isinstance(value, Mapping):
        parts, shape = list(value.values()), ("dict", frozenset(value))
    elif isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        parts, shape = list(value), ("list", len(value))
    for part in parts:
        if isinstance(part, bool) or not isinstance(part, (int, float)):
            raise ParameterError(
                f"A moving average takes numbers, but {part!r} in {value!r} is not a number.",
                fix="a number, a list of numbers, or a dict of numbers; take the part you want in a handler first.",
            )
    return shape


class MovingAvgFilterFactory(EndpointFactory):
    """Factory of an endpoint that averages the pages of one key and stores the means under another.

    Args:
        filter_length: number of pages in the window.
        endpoint_name: of the endpoint; unique among the filters of a node.
    """

    def __init__(
        self, input_key: DataKey, output_key: DataKey, filter_length: int, endpoint_name: str = "moving_avg_filter"
    ) -> None:
        super().__init__()
        if input_key == output_key:
            raise ParameterError(
                f"A moving average of '{input_key}' into itself would never end.", fix="another output_key."
            )
        self.input_key: DataKey = input_key
        self.output_key: DataKey = output_key
        self.filter_length: int = _checked_length(filter_length)
        self.endpoint_name: str = endpoint_name

    def get(self, parent: NodeApi) -> MovingAvgEndpoint:
        """Return the endpoint, with an empty window."""
        return MovingAvgEndpoint(self, parent, self.endpoint_name)


class MovingAvgEndpoint(Endpoint):
    """Stores one page of the output key for each page of the input key."""

    factory: MovingAvgFilterFactory

    def __init__(self, factory: MovingAvgFilterFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self._filter = MovingAvgFilter(factory.filter_length)
        self.task_handlers = {(TaskType.process_data, factory.input_key): self.smooth}

    def smooth(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Store the mean of the newest pages."""
        mean = self._filter.update(self.get_data(self.factory.input_key))
        return self.store_data_task(self.factory.output_key, mean)
