"""New code on probation: if a reloaded component fails in its first calls, the reload is rolled back.

    a handler, called through `Probations.wrap_handler` --> raises -----> rolled back, and the old one handles the task
    a handler of another component, on a task or page that new code has made --> raises --> rolled back, task dropped
    a loop that failed --> `Probations.handle_failure` --> task roll_back, an input --> rolled back
    a loop that failed on a page that new code stored, or tasks without end --> `Probations.blame_suspects` --> the same

New code that does not return is interrupted, which counts as raising (`new_code_calls.py`). What a call has scheduled
before it raises is dropped.

The old components begin again with their old code, and their factories have their state from before the reload. All of
this runs on the node's thread, between two calls, and depends only on tasks and their times: so a replay does the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial, wraps

from snr_sim.core.endpoint import Endpoint
from snr_sim.core.handlers import as_tasks, handler_name, schedule_returned
from snr_sim.core.loop import Loop
from snr_sim.core.machine import GuardedCall
from snr_sim.core.reload.new_code_calls import AbandonedCallError, origin_of
from snr_sim.core.reload.reload import AnyComponent, ComponentManager
from snr_sim.core.run_diagnostics import writers_of
from snr_sim.prelude import tasks
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import ComponentFailedError, TaskError
from snr_sim.prelude.task import Page, SomeTasks, Task, TaskHandler, TaskId, TaskType

# New code is on probation until this node time has passed and its component's handlers have been called this often. A
# loop is on probation for the time only, since a replay does not know its calls.
PROBATION_S = 3.0
PROBATION_CALLS = 100


@dataclass
class Probation:
    """A reload whose new code may still fail.

    Args:
        number: of the reload in its node, which began at node time `began_s`.
        old, new: the components that were exchanged, by name; those that the new code has added are in `new` only.
        undo: restores the code and the state of the factories.
        calls: number of handler calls of each new component, by its name.
    """

    number: int
    began_s: float
    old: dict[str, AnyComponent]
    new: dict[str, AnyComponent]
    undo: Callable[[], None]
    calls: dict[str, int] = field(default_factory=dict)

    def is_on(self, name: str, now_s: float) -> bool:
        """Return whether a component that it created is still on probation."""
        if name not in self.new:
            return False
        has_time = now_s - self.began_s < PROBATION_S
        return has_time or (not isinstance(self.new[name], Loop) and self.calls.get(name, 0) < PROBATION_CALLS)


class Probations:
    """The reloads of one node whose new code is on probation, the newest last.

    From now on `manager`, which exchanges the components, puts new ones on probation here.
    """

    def __init__(self, manager: ComponentManager) -> None:
        self._manager = manager
        self._node = manager.node
        self._probations: list[Probation] = []
        self._reloads = 0
        self._undone_s: dict[str, float] = {}  # by component: node time of its newest rollback
        self._calls = manager.calls
        if self._node.is_replay:
            self._node.machine.on_input = self.on_input
        manager.put_on_probation, manager.life.handle_failure = self.begin, self.handle_failure
        manager.put_added_on_probation = self.begin_added
        manager.life.blame_suspects, manager.life.maker_of = self.blame_suspects, self._calls.maker_of

    def begin(self, old: dict[str, AnyComponent], new: dict[str, AnyComponent], undo: Callable[[], None]) -> None:
        """Put a reload's components on probation; arguments as of `Probation`. The reload adds to them later."""
        self._reloads += 1
        now_s = self._node.machine.now_s
        self._probations = [one for one in self._probations if one.new]  # without reloads that exchanged nothing
        over = [not any(one.is_on(name, now_s) for name in one.new) for one in self._probations]
        passed = max((index for index, is_over in enumerate(over, 1) if is_over), default=0)
        del self._probations[:passed]  # a rollback stops at code that has passed
        self._probations.append(Probation(self._reloads, now_s, old, new, undo))
        self._node.machine.lookup.wrap_handler = self.wrap_handler
        self._node.machine.on_input = self.on_input
        self._manager.life.wrap_loop = self.wrap_loop

    def begin_added(self, task: Task, component: AnyComponent) -> None:
        """Put a component on probation if new code that is has made the task that added it."""
        _, maker = self._calls.made.get(id(task), (None, ""))
        probation = self._find(maker)
        if probation is not None:
            probation.new[component.name] = component
            self._node.handlers_changed()

    def on_input(self, task: Task, source: str) -> None:
        """Remember a page that a loop on probation brings; in a replay also a failed call."""
        if self._node.is_replay:
            self._calls.on_input(task, source)
        probation = self._find(source)
        if probation is not None and isinstance(probation.new[source], Loop):
            self._calls.keep(source, [task])

    def wrap_loop(self, loop: Loop) -> Callable[[], SomeTasks]:
        """Return what is called as a loop's `loop` in lock step; on probation it is interrupted if it does not return.

        A replay has no loops, so its interrupt is not recorded: it is a failure, which `handle_failure` records.
        """
        probation = self._probation_of(loop)
        is_on = probation is not None and probation.is_on(loop.name, self._node.machine.now_s)
        return partial(self._call_loop, loop) if is_on else loop.loop

    def _call_loop(self, loop: Loop) -> None:
        def call() -> None:
            schedule_returned(loop.loop(), loop, loop.loop)
            self._calls.check([task for task, source in self._node.inbox.waiting if source == loop.name], loop.name)

        try:
            self._calls.call("", loop.name, call)
        except (AbandonedCallError, TaskError):
            self._node.inbox.drop(loop.name)  # there may be very many
            raise

    def wrap_handler(self, component: Component, handler: TaskHandler) -> TaskHandler:
        """Return a wrapper of a handler that catches failures which new code on probation causes."""
        probation = self._probation_of(component)
        if probation is not None and probation.is_on(component.name, self._node.machine.now_s):
            return self._wrap_new(probation, component, handler)
        until_s = self._guarded_until_s()
        # Only what a replay has, too: neither the node's own endpoint, to which links listen, nor a console.
        is_replayed = isinstance(component, Endpoint) and component.is_robot_component
        if is_replayed and self._node.machine.now_s < until_s:
            return self._wrap_other(component, handler, until_s)
        return handler

    def _guarded_until_s(self) -> float:
        """Return the node time until which other components may fail on tasks of new code, as known now."""
        now_s = self._node.machine.now_s
        left = [(one, component) for one in self._probations for component in one.new.values()]
        ends_s = [
            one.began_s + PROBATION_S if isinstance(component, Loop) else float("inf")
            for one, component in left
            if one.is_on(component.name, now_s)
        ]
        return max([*ends_s, *(undone_s + PROBATION_S for undone_s in self._undone_s.values())], default=-float("inf"))

    def _wrap_new(self, probation: Probation, component: Component, handler: TaskHandler) -> TaskHandler:
        name, node = component.name, self._node
        what = f"{name}.{handler_name(handler)}"

        @wraps(handler)
        def call(task: Task, task_id: TaskId) -> SomeTasks:
            if node.components.get(name) is not component:  # another component has failed on this task
                return self._call_old_handler(name, task)
            probation.calls[name] = probation.calls.get(name, 0) + 1
            if not probation.is_on(name, node.machine.now_s):
                node.handlers_changed()  # from the next task on it is called directly
                return handler(task, task_id)
            try:
                returned, scheduled = self._calls.call_guarded(
                    what, name, lambda: as_tasks(handler(task, task_id), component, handler)
                )
                self._calls.check(returned, name)
                self._calls.keep(name, returned)
                return [*scheduled, *returned]
            except (Exception, SystemExit) as error:
                failure = self._manager.life.report.failure_in_handler(component, task, error)
            report = self._roll_back(probation, name, failure.message)
            return [report, *as_tasks(self._call_old_handler(name, task), component, handler)]

        return call

    def _wrap_other(self, component: Component, handler: TaskHandler, until_s: float) -> TaskHandler:
        node, calls = self._node, self._calls

        @wraps(handler)
        def call(task: Task, task_id: TaskId) -> SomeTasks:
            if node.machine.now_s >= until_s:
                node.handlers_changed()  # from the next task on it is called directly
            guarded = GuardedCall(component.name)
            try:
                returned = calls.run(guarded, lambda: as_tasks(handler(task, task_id), component, handler))
            except (Exception, SystemExit) as error:
                failure = self._manager.life.report.failure_in_handler(component, task, error)
                report = self._drop(task, guarded.read, failure.message)
                if report is None:
                    raise
                return report
            return [*guarded.scheduled, *returned]

        return call

    def _drop(self, task: Task, read: Sequence[Page], message: str) -> Task | None:
        """Return the report on a task on which another component has failed; None if new code is not the cause.

        It is if it has made that task, or else a page that was read.
        """
        what, _, fix = message.partition("\n  Try: ")
        for one in (origin_of(task), *read):
            made = f"page '{one.key}'" if isinstance(one, Page) else f"event '{one.name}'"
            _, late = self._calls.late.get(id(one), (None, ""))
            if late:
                text = f"{what}\n  '{late}' has made {made} before it was rolled back, so this task is dropped."
                return self._manager.report(TaskType.reload.value, late, False, f"{text}\n  Try: {fix}")
            _, maker = self._calls.made.get(id(one), (None, ""))
            probation = self._find(maker)
            if probation is not None:
                key = one.key if isinstance(one, Page) else one.name
                lines = "".join(f"{one.location}\n  " for one in writers_of(key, [probation.new[maker]])[:1])
                return self._roll_back(probation, maker, lines + message, f"'{maker}' has made {made}, ")
        return None

    def handle_failure(self, loop: Loop, failure: ComponentFailedError) -> bool:
        """Start a rollback if a loop failed on probation, on any thread; return whether it did."""
        probation = self._probation_of(loop)
        if probation is None or self._node.is_finished or not probation.is_on(loop.name, self._node.clock.now_s()):
            return False
        loop.is_removed = True
        self._node.enqueue_input(tasks.roll_back(loop.name, probation.number, failure.message), loop.name)
        return True

    def blame_suspects(self, failure: ComponentFailedError) -> bool:
        """Start the rollback of a suspect on probation, on any thread; return whether there is or was one."""
        if self._node.is_finished:
            return False
        now_s = self._node.clock.now_s()
        for name in failure.suspects:
            if failure.stored_at_s <= self._undone_s.get(name, float("-inf")):
                return True  # the page was in the queue when the component was rolled back
            probation = self._find(name, now_s)
            if probation is not None:
                self._node.enqueue_input(tasks.roll_back(name, probation.number, failure.message), name)
                return True
        return False

    def roll_back(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Handle the task of a loop that failed: roll back its reload, if that is the newest of its name."""
        match task.val_list:
            case [str(name), int(number), str(message)]:
                probation = next((one for one in reversed(self._probations) if name in one.new), None)
                if probation is not None and probation.number == number:
                    return self._roll_back(probation, name, message)
        return None

    def _probation_of(self, component: Component) -> Probation | None:
        return next((one for one in self._probations if one.new.get(component.name) is component), None)

    def end_failed_call(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Handle a failed call in its turn: it has taken effect in the task before which it was recorded."""
        match task.val_list:
            case [str(what), _]:
                self._calls.failed.pop(what, None)  # not yet abandoned: in a replay with other code
        return None

    def _find(self, name: str, now_s: float | None = None) -> Probation | None:
        """Return the newest reload of a component that is on probation, now if no node time is given."""
        now_s = self._node.machine.now_s if now_s is None else now_s
        probation = next((one for one in reversed(self._probations) if name in one.new), None)
        return probation if probation is not None and probation.is_on(name, now_s) else None

    def _roll_back(self, failed: Probation, name: str, message: str, subject: str = "") -> Task:
        """Restore the newest code of a component that has passed its probation, or else the first."""
        first = next(index for index, one in enumerate(self._probations) if name in one.new)
        undone = self._probations[first:]
        old: dict[str, AnyComponent] = {}
        new: dict[str, AnyComponent] = {}
        remarks = []
        for probation in reversed(undone):
            for created in probation.new.values():
                remarks += [failure.message for failure in self._manager.life.end_removed(created)]
            probation.undo()
            old = {one: was for one, was in old.items() if one not in probation.new} | probation.old
            new = probation.new | new
        self._undone_s[name] = self._node.machine.now_s
        self._calls.roll_back(new)
        del self._probations[first:]  # not before: until it is removed, a loop may fail on its thread
        there = self._manager.all()
        back = [one for one in there if new.get(one) is there[one]]  # the others have been removed since
        for one in back:
            self._manager.replace_component(new[one], old.get(one))
            if one in old:
                remarks += self._manager.begin_again(old[one])
            else:
                remarks.append(f"'{one}', which its code had added, was removed.")
        after_s = self._node.machine.now_s - failed.began_s
        what, _, fix = message.partition("\n  Try: ")
        as_before = ", ".join(one for one in back if one in old)
        words = f"{subject}{after_s:.3f} s after its reload, which was rolled back: {as_before} as before it."
        fix = fix or "correct this line and save the file again."
        lines = "\n  ".join([what, words, *remarks, f"Try: {fix}"])
        return self._manager.report(TaskType.reload.value, name, False, lines)

    def _call_old_handler(self, name: str, task: Task) -> SomeTasks:
        """Return the tasks of the restored component for a task."""
        machine = self._node.machine
        for component, handler, task_id, _ in machine.lookup.find(task):
            if component.name == name:
                machine.running = component
                return handler(task, task_id)
        return None
