"""Failures of a run in which virtual time stands still: they name the tasks that repeat, or who brings them.

Above the limit of `core/lockstep.py` some more tasks are executed one by one to find those that schedule each other.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from snr_sim.core.clocks import SimClock
from snr_sim.core.handlers import describe
from snr_sim.core.loop import Loop
from snr_sim.core.machine import HandlerError
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.run_diagnostics import attribute_location, writers_of
from snr_sim.core.source_location import SourceLocation, after_line, location_of
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.prelude.task import Task

WATCHED_TASKS = 60  # executed one by one above the limit, to find which schedules which
SHOWN_TASKS = 12
ENDLESS_FIX = (
    "let a Loop bring in what is to happen again, at its max_tick_rate_hz; a handler answers a page with another key, "
    "or only when something has changed."
)


class ExecutedTask(NamedTuple):
    """An executed task and its handlers."""

    node: str
    task: str
    handlers: tuple[tuple[str, SourceLocation | None], ...]
    components: tuple[str, ...]

    def __str__(self) -> str:
        called = [label if location is None else f"{label} ({location})" for label, location in self.handlers]
        return f"[{self.node}] {self.task}" + (f" -> {', '.join(called)}" if called else "")


def watch(nodes: Sequence[NodeParts], clock: SimClock) -> list[ExecutedTask]:
    """Execute some more tasks one by one, as lock step does; return them with their handlers."""
    steps: list[ExecutedTask] = []
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
            machine.accept_inputs()
            task_ref = machine.next_task_ref
            if task_ref is None:
                return steps
            task = task_ref if type(task_ref) is Task else task_ref[0]
            entries = machine.lookup.find(task)
            called = tuple((".".join(label), location_of(handler)) for _, handler, _, label in entries)
            names = tuple(component.name for component, *_ in entries)
            steps.append(ExecutedTask(node.name, describe(task.id()), called, names))
            try:
                machine.execute_next()
            except HandlerError:
                return steps
    return steps


def cycle_of(steps: Sequence[ExecutedTask]) -> list[ExecutedTask]:
    """Return the tasks that repeat in a cycle, or the last ones if there is no cycle.

    >>> cycle_of(list("xabcabc"))
    ['a', 'b', 'c']
    """
    newest = list(steps)
    for period in range(1, len(newest) // 2 + 1):
        if newest[-period:] == newest[-2 * period : -period]:
            return newest[-period:]
    return newest[-SHOWN_TASKS:]


def flood_failure(node: NodeParts, count: int) -> ComponentFailedError:
    """Return the failure of a component that has brought more inputs at one moment than may be executed."""
    waiting = list(node.inbox.waiting)
    ((task_id, source), _), *_ = Counter((task.id(), source) for task, source in waiting).most_common(1)
    component = node.components.get(source)
    writers = writers_of(str(task_id[1]), [] if component is None else [component])
    what = (
        f"'{source}' has brought {count} tasks to node '{node.name}' at t = {node.machine.now_s:.3f} s, most of them "
        f"{describe(task_id)}, without a pause: so time stands still."
    )
    fix = "a Loop brings in what is to happen again, at its max_tick_rate_hz; a thread of your own waits in between."
    message = after_line(writers[0].location if writers else None, what)
    return ComponentFailedError(f"{message}\n  Try: {fix}", node.name, source)


def endless_failure(nodes: Sequence[NodeParts], node: NodeParts, clock: SimClock) -> ComponentFailedError:
    """Return the failure of a node that has reached its limit and still has tasks; executes some of all nodes'."""
    cycle = cycle_of(watch(nodes, clock))
    locations = [location for step in cycle for _, location in step.handlers if location is not None]
    loops = [one for one in node.components.values() if isinstance(one, Loop)]
    due = [one for one in loops if one.next_tick_at_s is not None and one.next_tick_at_s <= clock.now_s()]
    locations += filter(None, (attribute_location(one, "next_tick_at_s") for one in due))
    lines = [str(step) for step in cycle[:SHOWN_TASKS]]
    lines += [f"[{node.name}] loop '{one.name}', whose next_tick_at_s is not later" for one in due]
    if len(cycle) > SHOWN_TASKS:
        lines.append(f"and {len(cycle) - SHOWN_TASKS} more")
    what = (
        f"node '{node.name}' has executed {node.config.max_tasks_per_moment} tasks at t = {node.machine.now_s:.3f} s, "
        "and there are more: tasks schedule each other without end, so time stands still."
    )
    fix = f"{ENDLESS_FIX} Config(max_tasks_per_moment=...) raises the bound."
    first = [str(locations[0])] if locations else []
    message = "\n  ".join([*first, what, *(f"  {line}" for line in lines), f"Try: {fix}"])
    suspects = dict.fromkeys(name for step in cycle for name in step.components if step.node == node.name)
    suspects |= dict.fromkeys(one.name for one in due)
    return ComponentFailedError(message, node.name, suspects=tuple(suspects))
