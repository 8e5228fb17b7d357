"""Filter of the student's tasks on their way into the grader's node: known kinds, plain values, bounded counts.

A component in the grader's process could do anything with the node. A graded component may do what a controller
does: store its own pages, send events, end the run. It cannot store what a sensor measures, change the components,
date its pages into the future, or fill the grader's memory.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from snr_sim.core.node import Node
from snr_sim.grading.remote.protocol import ComponentInfo
from snr_sim.prelude import tasks as kit_tasks
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.task import Page, Task, TaskType

MAX_TASKS_AT_ONE_MOMENT = 10_000
MAX_TASKS_PER_RUN = 500_000  # a controller of the course's robots sets off ten thousand in a minute
MAX_BYTES_PER_RUN = 256 << 20
MAX_KEYS = 1_000
MAX_NOTES = 100
_NAME_LENGTH = 200
_NOTE_LENGTH = 1_000


class TaskRejectedError(SnrError):
    """A task that a graded component may not bring."""


class TaskFilter:
    """Accepts or refuses the tasks of the student's components, which a file of the submission has made."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._moment_s = -1.0
        self._at_this_moment = 0
        self._tasks = 0
        self._notes = 0
        self._bytes = 0
        self._keys: set[str] = set()
        self._missed: set[str] = set()
        self.of_others: set[str] = set()  # keys that only components of the grader may store

    def component(self, made: ComponentInfo) -> None:
        """Check the description that a component sends.

        TaskRejectedError is raised if its name is too long, it has too many handlers, or its ticks send another event.
        """
        if made.repeats and not made.repeats.endswith(".step"):  # or it could be one that changes the node
            raise TaskRejectedError(
                f"The loop '{made.name[:_NAME_LENGTH]}' sends an event that is not a machine's step."
            )
        events = max(len(made.handlers), len(made.optional_events))
        if max(len(made.name), len(made.repeats)) > _NAME_LENGTH or events > MAX_KEYS:
            raise TaskRejectedError(
                f"The component '{made.name[:_NAME_LENGTH]}' has a name of {len(made.name)} characters and "
                f"{events} handlers.",
                fix=f"at most {_NAME_LENGTH} and {MAX_KEYS}.",
            )

    def count(self, now_s: float, tasks: int = 1) -> None:
        """Count work at one moment of virtual time; raise TaskRejectedError if there is no end to it."""
        if now_s != self._moment_s:
            self._moment_s, self._at_this_moment = now_s, 0
        self._at_this_moment += tasks
        if self._at_this_moment > MAX_TASKS_AT_ONE_MOMENT:
            raise TaskRejectedError(
                f"{self._file} has scheduled more than {MAX_TASKS_AT_ONE_MOMENT} tasks at one moment.",
                fix="find the handler that returns the task that it handles.",
            )
        self._tasks += tasks
        if self._tasks > MAX_TASKS_PER_RUN:
            raise TaskRejectedError(
                f"{self._file} has scheduled more than {MAX_TASKS_PER_RUN} tasks in one run.",
                fix="return one command for each reading, and no more.",
            )

    def notes(self, notes: Sequence[str]) -> list[str]:
        """Return the notes of a step up to the limit for the end of a run; the rest is left out."""
        admitted = [note[:_NOTE_LENGTH] for note in notes[: MAX_NOTES - self._notes]]
        self._notes += len(admitted)
        return admitted

    def missed(self, keys: Sequence[str]) -> list[str]:
        """Return those of the requested but never stored keys that are to be reported at the end of the run."""
        new = [key for key in keys[: MAX_KEYS + 1] if len(key) <= _NAME_LENGTH and key not in self._missed]
        admitted = new[: MAX_KEYS - len(self._missed)]
        self._missed.update(admitted)
        return admitted

    def tasks(self, raws: Sequence[msgspec.Raw], node: Node, component: str) -> list[Task]:
        """Return tasks that a component has returned or scheduled; raise TaskRejectedError if one may not enter."""
        if not raws:
            return []
        self.count(node.get_time_s(), len(raws))
        return [self._task(bytes(raw), node, component) for raw in raws]

    def _task(self, raw: bytes, node: Node, component: str) -> Task:
        self._bytes += len(raw)
        if self._bytes > MAX_BYTES_PER_RUN:
            raise TaskRejectedError(
                f"{self._file} has stored more than {MAX_BYTES_PER_RUN >> 20} MB in one run.",
                fix="store less, or less often.",
            )
        try:
            task = Task.deserialize(raw)
        except SnrError as error:
            reason = getattr(error.__cause__, "message", error.message)
            fix = "numbers, texts, lists, dicts, tuples, numpy arrays, and dataclasses of these can."
            what = f"made a task with a value that cannot leave its process: {reason}"
            raise _rejected(component, what, fix) from error
        if len(task.name) > _NAME_LENGTH:
            raise _rejected(component, f"made a task with a name of {len(task.name)} characters.")
        if task.type is TaskType.store_page:
            return self._store(task, node, component)
        if task.type is TaskType.process_data and task.val_list:
            return self._process(raw, node, component)
        if task.type is TaskType.reload or task.name in kit_tasks.CHANGE_TASK_NAMES:
            fix = "do not use reload, add_component and remove_component."
            raise _rejected(component, "requested a change of components, which a graded run does not allow.", fix)
        if task.name == kit_tasks.FINISH_TASK_NAME and task.type is TaskType.event:
            reason = task.val_list[0] if task.val_list else ""
            if task != kit_tasks.finish(reason) or type(reason) is not str:
                raise _rejected(component, f"made a task '{task.name}' by itself.", "use tasks.finish('reason').")
        return task

    def _process(self, raw: bytes, node: Node, component: str) -> Task:
        """Return the task that is handled now, if it is that: another one could pass a page off as a sensor's."""
        handled = node.machine.task
        if handled is None or handled.serialize() != raw:
            raise _rejected(component, "made a process_data task that carries values.", "tasks.process_data(key).")
        return handled

    def _store(self, task: Task, node: Node, component: str) -> Task:
        page = task.val_list[0] if len(task.val_list) == 1 else None
        if not isinstance(page, Page) or page.key != task.name:
            what = f"made a store_page task '{task.name}' that does not carry exactly this page."
            raise _rejected(component, what, "use self.store_data_task(key, data).")
        if page.key in self.of_others:
            what = f"stored the page '{page.key}', which it is not allowed to store."
            raise _rejected(component, what, "choose a key of your own.")
        if not page.created_at_s <= node.get_time_s():  # so that nan is refused, too
            what = f"stored a page '{page.key}' of t = {page.created_at_s} s, which is in the future."
            raise _rejected(component, what, "use self.store_data_task(key, data), which sets the time.")
        self._keys.add(page.key)
        if len(self._keys) > MAX_KEYS:
            what = f"has stored pages under more than {MAX_KEYS} keys."
            raise _rejected(component, what, "use few keys; put a changing number into the page's data.")
        return task


def _rejected(component: str, what: str, fix: str = "") -> TaskRejectedError:
    return TaskRejectedError(f"'{component}' {what}", fix=fix)
