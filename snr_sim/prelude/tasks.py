"""Functions that make the most frequent tasks of handlers: `tasks.event("landed")`, `tasks.terminate("done")`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from snr_sim.prelude.errors import TaskError
from snr_sim.prelude.retired import Retired
from snr_sim.prelude.task import Page, Task, TaskType

if TYPE_CHECKING:
    from snr_sim.prelude.component import Factory

_EVENT = TaskType.event  # looked up once: in Python 3.11 a member of an Enum takes 0.1 us to find
_NO_VALUES: Sequence[Any] = ()

ADD_COMPONENT_TASK_NAME = "add_component"
REMOVE_COMPONENT_TASK_NAME = "remove_component"
REMOVE_ENDPOINT_TASK_NAME = "remove_endpoint"  # the thesis' name of it
ROLL_BACK_TASK_NAME = "roll_back"
FAILED_CALL_TASK_NAME = "failed_call"
CHANGE_TASK_NAMES = frozenset(
    (ADD_COMPONENT_TASK_NAME, REMOVE_COMPONENT_TASK_NAME, REMOVE_ENDPOINT_TASK_NAME, ROLL_BACK_TASK_NAME)
)
FINISH_TASK_NAME = "finish_node"
# How often a task that finishes a node moves to the end of the queue: so many generations of following tasks run.
FINISH_GENERATIONS = 10


def event(name: str, val_list: Sequence[Any] = _NO_VALUES) -> Task:
    """Return a task that reports an event, with a list of its own of the values.

    Raises:
        TaskError: the name is not text, or the values are not a list or a tuple.

    >>> event("contact", ["left"]).val_list
    ['left']
    """
    if type(name) is not str:
        _check_text(name, "An event's name", 'tasks.event("measured", [5]): values go into the list')
    if val_list is _NO_VALUES:
        return Task(_EVENT, name)
    if isinstance(val_list, (list, tuple)):
        return Task(_EVENT, name, list(val_list))
    raise TaskError(
        f"The event '{name}' carries {val_list!r}, which is not a list.", fix=f"tasks.event({name!r}, [{val_list!r}])."
    )


def store_page(page: Page) -> Task:
    """Return a task that puts a page in the datastore."""
    return Task(TaskType.store_page, page.key, [page])


store_data: Retired = Retired(
    "tasks.store_data", "self.store_data_task(key, data), which knows the page's node and time."
)


def process_data(key: str) -> Task:
    """Return a task that processes the newest page of `key`; one that follows a stored page contains that page."""
    return Task(TaskType.process_data, key)


def terminate(reason: str) -> Task:
    """Return the task that ends the node; it overtakes all queued tasks.

    Raises:
        TaskError: the reason is not text.
    """
    _check_text(reason, "The reason to end", 'tasks.terminate("landed")')
    return Task(TaskType.terminate, reason)


def finish(reason: str) -> Task:
    """Return the task that ends the node after all queued tasks and those that follow from them, without time limit.

    Raises:
        TaskError: the reason is not text.
    """
    _check_text(reason, "The reason to end", 'tasks.finish("landed")')
    return Task(TaskType.event, FINISH_TASK_NAME, [reason, FINISH_GENERATIONS])


def _check_text(given: object, what: str, fix: str) -> None:
    if not isinstance(given, str):
        raise TaskError(f"{what} is {given!r}, which is not text.", fix=f"{fix}.")


def reload_component(name: str, *more: str) -> Task:
    """Return a task that creates components again from the current code of their files; "all" is every one.

    Of several names, a file that their components share is read once.
    """
    return Task(TaskType.reload, name, list(more))


def add_component(factory: Factory, start_component: bool = True) -> Task:
    """Return a task that adds the factory's component to the running node.

    Without `start_component` its `begin` is not called; nor are `halt` and `terminate`.
    """
    return Task(TaskType.event, ADD_COMPONENT_TASK_NAME, [factory, start_component])


def remove_component(name: str) -> Task:
    """Return a task that halts the component of that name and removes it from the running node."""
    return Task(TaskType.event, REMOVE_COMPONENT_TASK_NAME, [name])


def roll_back(name: str, number: int, message: str) -> Task:
    """Return the task that rolls back the reload with this number after a failure of a loop."""
    return Task(TaskType.event, ROLL_BACK_TASK_NAME, [name, number, message])


def failed_call(what: str, message: str) -> Task:
    """Return the task that records a call which a replay does not repeat, and why: see `reload/new_code_calls.py`."""
    return Task(TaskType.event, FAILED_CALL_TASK_NAME, [what, message])
