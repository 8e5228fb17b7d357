"""Limit on tasks per instant of virtual time: tasks that schedule each other endlessly would stop the clock."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from snr_sim.core.blame import Place, place_of
from snr_sim.core.clocks import SimClock
from snr_sim.core.handlers import describe
from snr_sim.core.machine import EventMachine, HandlerFailed
from snr_sim.core.node_parts import NodeParts
from snr_sim.prelude.errors import ComponentFailed

WATCHED_TASKS = 60  # executed one by one above the limit, to find which schedules which
SHOWN_TASKS = 12


class Step(NamedTuple):
    """An executed task and its handlers."""

    node: str
    task: str
    handlers: tuple[tuple[str, Place | None], ...]

    def __str__(self) -> str:
        called = [label if place is None else f"{label} ({place})" for label, place in self.handlers]
        return f"[{self.node}] {self.task}" + (f" -> {', '.join(called)}" if called else "")


class Moments:
    """Limit on the machines of a run, reset at each instant.

    Args:
        nodes: of the run.
        clock: their clock.
    """

    def __init__(self, nodes: Sequence[NodeParts], clock: SimClock) -> None:
        self._nodes = nodes
        self._clock = clock
        self._machines: list[tuple[EventMachine, int]] = [
            (node.machine, node.config.max_tasks_per_moment) for node in nodes
        ]

    def begin(self) -> None:
        """Reset each node's number of tasks for a new instant."""
        for machine, at_most in self._machines:
            machine.most_executed = machine.executed + at_most

    def check(self) -> None:
        """Raise if a node has reached its limit and still has tasks.

        Raises:
            ComponentFailed: a node has; the message names the tasks that schedule each other.
        """
        for machine, _ in self._machines:
            if machine.executed >= machine.most_executed and machine.queued and not machine.is_ended:
                node = next(node for node in self._nodes if node.machine is machine)
                raise _failure(node, cycle_of(watch(self._nodes, self._clock)))


def watch(nodes: Sequence[NodeParts], clock: SimClock) -> list[Step]:
    """Execute some more tasks one by one, as lock step does; return them with their handlers."""
    steps: list[Step] = []
    moment_s = clock.now_s()
    while len(steps) < WATCHED_TASKS:
        if not any(node.machine.queued for node in nodes if not node.is_terminated):
            if clock.next_s != moment_s:
                return steps
            clock.run_next()  # a loop that always requests its next tick at once
        for node in nodes:
            machine = node.machine
            if node.is_terminated or not machine.queued:
                continue
            machine.let_in()
            task = machine.next_task
            if task is None:
                return steps
            entries = machine.lookup.find(task)
            called = tuple((".".join(label), place_of(handler)) for _, handler, _, label in entries)
            steps.append(Step(node.name, describe(task.id()), called))
            try:
                machine.execute_next()
            except HandlerFailed:
                return steps
    return steps


def cycle_of(steps: Sequence[Step]) -> list[Step]:
    """Return the tasks that repeat in a cycle, or the last ones if there is no cycle.

    >>> cycle_of(list("xabcabc"))
    ['a', 'b', 'c']
    """
    newest = list(steps)
    for period in range(1, len(newest) // 2 + 1):
        if newest[-period:] == newest[-2 * period : -period]:
            return newest[-period:]
    return newest[-SHOWN_TASKS:]


def _failure(node: NodeParts, cycle: Sequence[Step]) -> ComponentFailed:
    places = [place for step in cycle for _, place in step.handlers if place is not None]
    lines = [str(step) for step in cycle[:SHOWN_TASKS]]
    if len(cycle) > SHOWN_TASKS:
        lines.append(f"and {len(cycle) - SHOWN_TASKS} more")
    what = (
        f"node '{node.name}' has executed {node.config.max_tasks_per_moment} tasks at t = {node.machine.now_s:.3f} s, "
        "and there are more: tasks ask for each other for ever, so time stands still."
    )
    fix = (
        "let a Loop bring in what is to happen again, at its max_tick_rate_hz; a handler answers a page with another "
        "key, or only when something has changed. Config(max_tasks_per_moment=...) raises the bound."
    )
    first = [str(places[0])] if places else []
    return ComponentFailed("\n  ".join([*first, what, *(f"  {line}" for line in lines), f"Try: {fix}"]), node.name)
