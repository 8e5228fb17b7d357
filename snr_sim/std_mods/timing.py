"""Time: a timeout that schedules a task, a stopwatch of tasks, and a timer for programs around nodes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from snr_sim.core.clocks import WallClock
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.prelude import tasks
from snr_sim.prelude.clock import Clock
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, Task, TaskId

TIMEOUT = "timeout"


class TimeoutLoopFactory(LoopFactory):
    """Factory of a loop that schedules a task `seconds` plus `ms` after the node begins; exact in virtual time.

    Args:
        task: to schedule; by default a task that ends the node.
        name: of the loop; unique among the timeouts of a node.

    Raises:
        ParameterError: the time is negative or not a number.
    """

    def __init__(
        self, seconds: float = 0.0, ms: float = 0.0, task: SomeTasks = None, name: str = "timeout_loop"
    ) -> None:
        super().__init__()
        self.delay_s: float = seconds + ms / 1000.0
        if not (math.isfinite(self.delay_s) and self.delay_s >= 0.0):
            raise ParameterError(f"A timeout of {self.delay_s} s.", fix="TimeoutLoopFactory(seconds=1.5).")
        self.task: SomeTasks = tasks.terminate(TIMEOUT) if task is None else task
        self.name: str = name

    def get(self, parent: NodeApi) -> TimeoutLoop:
        """Return the loop."""
        return TimeoutLoop(self, parent, self.name)


class TimeoutLoop(Loop):
    """Loop with a single, delayed tick."""

    factory: TimeoutLoopFactory

    def __init__(self, factory: TimeoutLoopFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.first_tick_after_s: float = factory.delay_s

    def loop(self) -> None:
        """Schedule the tasks: the time has passed."""
        self.schedule(self.factory.task)
        self.stop()


class StopwatchEndpointFactory(EndpointFactory):
    """Factory of an endpoint that appends the node's time [s] at each matching task to a list.

    The caller owns the list, so it is available after the run.
    """

    def __init__(self, times: list[float], ids: Sequence[TaskId], name: str = "stopwatch") -> None:
        super().__init__()
        self.times: list[float] = times
        self.ids: list[TaskId] = list(ids)
        self.name: str = name

    def get(self, parent: NodeApi) -> StopwatchEndpoint:
        """Return the endpoint."""
        return StopwatchEndpoint(self, parent, self.name)


class StopwatchEndpoint(Endpoint):
    """Stores the times of tasks."""

    factory: StopwatchEndpointFactory

    def __init__(self, factory: StopwatchEndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = dict.fromkeys(factory.ids, self.record_time)

    def record_time(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Append the time."""
        self.factory.times.append(self.get_time_s())
        return None


class Timer:
    """Counter of seconds since its creation, by a wall clock if no other is given; setting it has no effect.

    In a node `self.get_time_s()` is repeatable.

    >>> timer = Timer()
    >>> 0.0 <= timer.current_s() < 60.0
    True
    """

    def __init__(self, clock: Clock | None = None) -> None:
        self._clock = clock or WallClock()
        self._start_s = self._clock.now_s()

    def current_s(self) -> float:
        """Return seconds since the creation of the timer."""
        return self._clock.now_s() - self._start_s
