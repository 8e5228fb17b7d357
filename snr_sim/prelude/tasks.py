"""Short ways to make the tasks that handlers return most: `tasks.event("landed")`, `tasks.terminate("done")`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from snr_sim.prelude.errors import TaskError
from snr_sim.prelude.page import Page
from snr_sim.prelude.retired import Retired
from snr_sim.prelude.task import Task, TaskType

if TYPE_CHECKING:
    from snr_sim.prelude.component import Factory

_EVENT = TaskType.event  # looked up once: in Python 3.11 a member of an Enum takes 0.1 us to find
_NO_VALUES: Sequence[Any] = ()

ADD_COMPONENT_TASK_NAME = "add_component"
REMOVE_COMPONENT_TASK_NAME = "remove_component"
REMOVE_ENDPOINT_TASK_NAME = "remove_endpoint"  # the thesis' name for the same
ROLL_BACK_TASK_NAME = "roll_back"
CHANGE_TASK_NAMES = frozenset(
    (ADD_COMPONENT_TASK_NAME, REMOVE_COMPONENT_TASK_NAME, REMOVE_ENDPOINT_TASK_NAME, ROLL_BACK_TASK_NAME)
)
FINISH_TASK_NAME = "finish_node"
# How often a task that finishes a node goes to the end of the queue: so many generations of what follows are done.
FINISH_GENERATIONS = 10


def event(name: str, val_list: Sequence[Any] = _NO_VALUES) -> Task:
    """Return a task that tells that something happened.

    Args:
        name: what happened.
        val_list: values it carries, a list or a tuple; the task has a list of its own.

    Raises:
        TaskError: the values are no list.

    >>> event("contact", ["left"]).val_list
    ['left']
    """
    if val_list is _NO_VALUES:
        return Task(_EVENT, name)
    if isinstance(val_list, (list, tuple)):
        return Task(_EVENT, name, list(val_list))
    raise TaskError(
        f"The event '{name}' carries {val_list!r}, which is no list of values.",
        fix=f"tasks.event({name!r}, [{val_list!r}]).",
    )


def store_page(page: Page) -> Task:
    """Return a task that puts a page in the datastore."""
    return Task(TaskType.store_page, page.key, [page])


store_data = Retired("tasks.store_data", "self.store_data_task(key, data), which knows the page's node and time.")


def process_data(key: str) -> Task:
    """Return a task that has the newest page of `key` processed; one that follows a stored page carries that page."""
    return Task(TaskType.process_data, key)


def terminate(reason: str) -> Task:
    """Return the task that ends the node; it passes everything that is queued."""
    return Task(TaskType.terminate, reason)


def finish(reason: str) -> Task:
    """Return the task that ends the node once what is queued, and what follows from that, is done, however long."""
    return Task(TaskType.event, FINISH_TASK_NAME, [reason, FINISH_GENERATIONS])


def reload_component(name: str, *more: str) -> Task:
    """Return a task that makes components anew, from the code that stands in their files then.

    Args:
        name: of the component; "all" is every one.
        more: names of others to be made anew together with it: a file that they share is read once.
    """
    return Task(TaskType.reload, name, list(more))


def add_component(factory: Factory, start_component: bool = True) -> Task:
    """Return a task that adds what the factory makes to the running node.

    Args:
        factory: of the component.
        start_component: whether its `begin` is called. If not, nor are `halt` and `terminate`.
    """
    return Task(TaskType.event, ADD_COMPONENT_TASK_NAME, [factory, start_component])


def remove_component(name: str) -> Task:
    """Return a task that halts the component of that name and take it out of the running node."""
    return Task(TaskType.event, REMOVE_COMPONENT_TASK_NAME, [name])


def roll_back(name: str, number: int, message: str) -> Task:
    """Return the task that rolls back a reload of which a loop has failed.

    Args:
        name: of the loop.
        number: of the reload among those of its node.
        message: what went wrong, in words.
    """
    return Task(TaskType.event, ROLL_BACK_TASK_NAME, [name, number, message])
