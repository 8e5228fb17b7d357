"""Timeout: schedules a task once some time has passed."""

from __future__ import annotations

import math

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks

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
