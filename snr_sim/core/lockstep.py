"""Run nodes: in lock step on the virtual clock, or one node on the wall clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial

from snr_sim.core.clocks import SimClock
from snr_sim.core.machine import EventMachine
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.runaway import endless_failure, flood_failure
from snr_sim.core.watchdog import Watchdog
from snr_sim.prelude.errors import ComponentFailedError

NO_MORE_EVENTS = "nothing left to do"
TIME_LIMIT = "time limit"
# After a rollback the old code handles what the new code has queued, so there may be this many times as many tasks.
MAX_LEFTOVER = 10


def run_node(node: NodeParts) -> None:
    """Run one node until it ends, on the clock it has; raise what `LockStep.run` raises."""
    if isinstance(node.clock, SimClock):
        LockStep([node], node.clock).run()
        return

    def run() -> str:
        node.begin()
        while not node.is_terminated:
            node.run_ready()
            if not node.is_terminated:
                node.inbox.wait()
        return ""

    _run_watched([node], run)


class TaskLimit:
    """Limit on the tasks that each machine of a run executes at one instant of virtual time.

    Tasks that schedule each other endlessly, or ticks of a loop at one moment (`next_tick_at_s` in the past), would
    stop the clock. The run then ends, unless new code on probation is among what repeats, which is rolled back. The
    machine counts to the limit anyway, so it costs nothing; a replay needs none, as it executes what a trace contains.
    """

    def __init__(self, nodes: Sequence[NodeParts], clock: SimClock) -> None:
        self._nodes = nodes
        self._clock = clock
        self._machines: list[tuple[EventMachine, int]] = [
            (node.machine, node.config.max_tasks_per_moment) for node in nodes
        ]
        self._inputs: dict[str, tuple[float, int]] = {}  # by node: time [s] of its last burst, inputs in bursts there
        for node in nodes:
            node.machine.on_burst = partial(self._count_burst, node)

    def begin(self) -> None:
        """Reset each node's number of tasks for a new instant."""
        for machine, at_most in self._machines:
            machine.max_executed = machine.executed + at_most

    def _count_burst(self, node: NodeParts, count: int) -> None:
        """Raise a ComponentFailedError if a node has accepted more inputs at this moment than it may execute."""
        now_s = self._clock.now_s()
        before_s, inputs = self._inputs.get(node.name, (now_s, 0))
        inputs = count + (inputs if before_s == now_s else 0)
        self._inputs[node.name] = now_s, inputs
        if inputs > node.config.max_tasks_per_moment:
            raise flood_failure(node, inputs)

    def check(self) -> bool:
        """Return whether a node that had reached its limit may continue, as the code that caused it is rolled back.

        Raises:
            ComponentFailedError: a node has reached its limit and still has tasks. It names the tasks.
        """
        may_continue = False
        for machine, at_most in self._machines:
            if machine.executed >= machine.max_executed and machine.queued and not machine.is_ended:
                node = next(node for node in self._nodes if node.machine is machine)
                failure = endless_failure(self._nodes, node, self._clock)
                if not node.blame_suspects(failure):
                    raise failure
                machine.max_executed = machine.executed + MAX_LEFTOVER * (at_most + machine.queued)
                may_continue = True
        return may_continue


class LockStep:
    """Nodes under one virtual clock: time advances only when every node is idle at the present instant.

    Args:
        nodes: in the order in which they work at the same instant.
        clock: their clock.
        pace: virtual seconds per wall second; None is as fast as possible.
        until_s: virtual time limit.
    """

    def __init__(
        self, nodes: Sequence[NodeParts], clock: SimClock, pace: float | None = None, until_s: float | None = None
    ) -> None:
        self._nodes = list(nodes)
        self._clock = clock
        self._pace = pace
        self._until_s = float("inf") if until_s is None else until_s
        self._wall_start_s = 0.0
        self._task_limit = TaskLimit(self._nodes, clock)

    def run(self) -> None:
        """Run until every node has ended, nothing is due any more, or the time limit is reached.

        Raises:
            ComponentFailedError: a handler or a loop raised; every node has been halted.
        """
        _run_watched(self._nodes, self._run, is_endless=self._pace is None and self._until_s == float("inf"))

    def _run(self) -> str:
        for node in self._nodes:
            node.begin()
        self._wall_start_s = time.monotonic()
        if not self._nodes:
            return NO_MORE_EVENTS
        clock, only = self._clock, self._nodes[0] if len(self._nodes) == 1 else None
        task_limit, moment_s = self._task_limit, clock.now_s()
        task_limit.begin()
        self._settle()
        running = [node.machine for node in self._nodes]
        alone, at_most = running[0], self._nodes[0].config.max_tasks_per_moment
        while running:
            if running[0].is_ended:
                del running[0]
                continue
            next_s = clock.next_s
            if next_s is None:
                return NO_MORE_EVENTS
            if next_s > self._until_s:
                return TIME_LIMIT
            if self._pace is not None and not self._wait_for(next_s):
                self._settle()  # input arrived during the wait
                continue
            if next_s > moment_s:
                moment_s = next_s
                if only is None:
                    task_limit.begin()
                else:
                    alone.max_executed = alone.executed + at_most
            clock.run_next()
            if only is None:
                self._settle()
            elif only.inbox.waiting:  # all work of an idle node arrives in its inbox
                alone.now_s = next_s
                only.run_ready()
                while alone.executed >= alone.max_executed and task_limit.check():
                    only.run_ready()
        return ""

    def _settle(self) -> None:
        """Run every node until all are idle at this instant."""
        busy = True
        while busy:
            busy = False
            for node in self._nodes:
                if node.is_terminated:
                    node.end()
                elif node.machine.queued or node.inbox.failure is not None:
                    node.machine.now_s = self._clock.now_s()
                    node.run_ready()
                    busy = True
            busy = self._task_limit.check() or busy

    def _wait_for(self, time_s: float) -> bool:
        """Wait until the wall clock reaches this time; return False if a node gets work before."""
        assert self._pace is not None
        inbox = next((node.inbox for node in self._nodes if not node.is_terminated), None)
        if inbox is None:
            return True
        while True:
            spare_s = self._wall_start_s + time_s / self._pace - time.monotonic()
            if spare_s <= 0:
                return True
            inbox.wait(min(spare_s, 0.05 if len(self._nodes) > 1 else spare_s))
            if any(node.machine.queued or node.inbox.failure is not None for node in self._nodes):
                return False


def _run_watched(nodes: Sequence[NodeParts], run: Callable[[], str], is_endless: bool = False) -> None:
    """Run nodes by `run`, which returns why it ended, then end them, all under a watchdog."""
    with Watchdog(nodes, is_endless=is_endless) as watchdog:
        try:
            reason = run()
        except BaseException as error:
            failure = watchdog.failure or error  # report a watchdog's interrupt as its failure, not as a user's Ctrl-C
            _end_all(nodes, failure)
            if failure is error:
                raise
            raise failure from error
        _end_all(nodes, reason)


def _end_all(nodes: Sequence[NodeParts], cause: str | BaseException) -> None:
    """End every node; raise the first failure to do so, unless another one is already on its way."""
    failure: Exception | None = None
    error = cause if isinstance(cause, Exception) else None
    if isinstance(cause, str):
        reason = cause
    else:
        reason = "interrupted" if isinstance(cause, KeyboardInterrupt) else f"error: {type(cause).__name__}"
    for node in nodes:
        try:
            if isinstance(cause, ComponentFailedError):
                node.report.record_failure(cause)
            node.end(reason, error)
        except Exception as another:
            if failure is not None or not isinstance(cause, str):  # another one is raised
                node.report.notes.append(str(another))
            failure = failure or another
    if failure is not None and isinstance(cause, str):
        raise failure
