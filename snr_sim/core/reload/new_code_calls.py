"""Guarded calls of new code: what a call schedules is queued only if it returns; one that does not is interrupted.

An interrupt depends on the wall clock, so it is an input: event `failed_call` (which call, why), recorded before the
task in which it was. A replay gets it before that task, and abandons the call in the same place without executing it.
So what the call had changed outside of its component and its factory, which are put back, stays in the run only. The
same event records a loop that could not begin, since a replay begins no loops.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from typing import Any, TypeVar

from snr_sim.core.component import CORE_NAME
from snr_sim.core.datastore import check_executable
from snr_sim.core.handlers import describe
from snr_sim.core.machine import GuardedCall
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.runaway import ENDLESS_FIX
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ComponentFailedError, TaskError
from snr_sim.prelude.task import Page, Task

MAX_MADE = 1000  # tasks of new code that are remembered
T = TypeVar("T")


class AbandonedCallError(ComponentFailedError):
    """A call of new code was interrupted, now or in the recorded run: then a replay does not call it."""


class NewCodeCalls:
    """Calls of one node's new code, and the tasks that it has made.

    Attributes:
        made: by the id of their page, or their own: that object, to keep it alive, and the name of the component.
        late: the same of code that has been rolled back since.
        failed: by call: messages of those to come in a replay, in order.
    """

    def __init__(self, node: NodeParts) -> None:
        self.made: dict[int, tuple[object, str]] = {}
        self.late: dict[int, tuple[object, str]] = {}
        self.failed: dict[str, list[str]] = {}
        self._node = node

    def on_input(self, task: Task, source: str) -> None:
        """Remember a failed call that a replay brings."""
        match task.val_list:
            case [str(what), str(message)] if (source, task.name) == (CORE_NAME, tasks.FAILED_CALL_TASK_NAME):
                self.failed.setdefault(what, []).append(message)

    def record(self, what: str, message: str) -> None:
        """Record a failed call that a replay cannot repeat."""
        self._node.machine.record_effective(tasks.failed_call(what, message), CORE_NAME)

    def raise_recorded(self, what: str, component: str) -> None:
        """Raise an AbandonedCallError if the call failed in the recorded run."""
        if self.failed.get(what):
            raise AbandonedCallError(self.failed[what].pop(0), self._node.name, component)

    def call(self, what: str, component: str, function: Callable[[], T]) -> T:
        """Call new code of a component, and queue the tasks that it has scheduled; else as `call_guarded`."""
        returned, scheduled = self.call_guarded(what, component, function)
        self._node.machine.schedule(scheduled)
        return returned

    def call_guarded(self, what: str, component: str, function: Callable[[], T]) -> tuple[T, list[Task]]:
        """Call new code of a component; return what it returned, and the tasks that it has scheduled.

        Args:
            what: names the call, once per task; empty: an interrupt is not recorded.

        Raises:
            AbandonedCallError: it was interrupted.
        """
        self.raise_recorded(what, component)
        guarded = GuardedCall(component, is_interruptible=not self._node.is_replay)
        try:
            returned = self.run(guarded, function)
        except BaseException as error:
            if not guarded.is_interrupted or isinstance(error, KeyboardInterrupt):
                raise
        else:
            if not guarded.is_interrupted:  # its code has not caught an interrupt
                self.check(guarded.scheduled, component)
                self.keep(component, guarded.scheduled)
                return returned, guarded.scheduled
        if what:
            self.record(what, guarded.message)
        raise AbandonedCallError(guarded.message, self._node.name, component)

    def run(self, guarded: GuardedCall, function: Callable[[], T]) -> T:
        """Call a function, guarded, and return what it returned."""
        machine = self._node.machine
        try:
            machine.guarded_call = guarded
            return function()
        finally:
            machine.guarded_call = None  # until here it may be interrupted, and not after it

    def check(self, made: Sequence[Task], component: str) -> None:
        """Raise a TaskError if the node cannot execute what a call has made, or not as many tasks at one moment."""
        for task in made:
            check_executable(task)
        if len(made) > self._node.config.max_tasks_per_moment:
            ((usual, _),) = Counter(task.id() for task in made).most_common(1)
            raise TaskError(
                f"'{component}' has made {len(made)} tasks in one call, most of them {describe(usual)}.",
                fix=ENDLESS_FIX,
            )

    def keep(self, component: str, made: Sequence[Task]) -> None:
        """Remember tasks that a component's new code has made."""
        for task in made:
            one: Any = origin_of(task)
            self.made[id(one)] = one, component
        while len(self.made) > MAX_MADE:
            del self.made[next(iter(self.made))]

    def maker_of(self, page: Page | None) -> str:
        """Return the component whose new code has made a page, if it is among the last ones; else ""."""
        one = self.made.get(id(page)) or self.late.get(id(page))
        return "" if one is None else one[1]

    def roll_back(self, components: Collection[str]) -> None:
        """Count the tasks that these components' new code has made as late."""
        late = {key: one for key, one in self.made.items() if one[1] in components}
        self.made = {key: one for key, one in self.made.items() if key not in late}
        self.late = dict([*self.late.items(), *late.items()][-MAX_MADE:])


def origin_of(task: Task) -> Page | Task:
    """Return what stays the same from where a task is made to its handlers: its page, if it has one."""
    return task.page or task
