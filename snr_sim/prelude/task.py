"""Tasks: the only messages inside a node. A handler takes one and returns the next ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import Any, TypeAlias

import msgspec

from snr_sim.prelude.errors import TaskError, ValueEncodingError
from snr_sim.prelude.page import KINDS, Page
from snr_sim.prelude.values import decode_value, encode_value


class TaskType(StrEnum):
    """The five kinds of task. A StrEnum, because its hash is C code and it is its own JSON."""

    event = "event"
    store_page = "store_page"
    store_data = "store_page"  # an alias, also used by the thesis' text
    process_data = "process_data"
    reload = "reload"
    terminate = "terminate"


TaskName: TypeAlias = str
# What a handler is registered for: every task of a type, or only those with one name.
TaskId: TypeAlias = TaskType | tuple[TaskType, TaskName]


_STORE_PAGE = TaskType.store_page  # looked up once: in Python 3.11 a member of an Enum takes 0.1 us to find


class Task(msgspec.Struct, frozen=True):
    """One piece of work for a node's handlers.

    A frozen msgspec Struct: the event machine makes these by the million, and a frozen dataclass costs four
    times as much to make.

    Args:
        type: one of the five kinds.
        name: subject: an event's name, a page's key, a component's name, a reason to terminate.
        val_list: values; each task has a list of its own.

    >>> Task(TaskType.event, "start").id()
    (<TaskType.event: 'event'>, 'start')
    """

    type: TaskType
    name: TaskName
    val_list: list[Any] = []

    @property
    def page(self) -> Page | None:
        """The page in a `store_page` or `process_data` task; None if there is none."""
        values = self.val_list
        return values[0] if values and type(values[0]) is Page else None

    def id(self) -> tuple[TaskType, TaskName]:
        """Return the type and name that handlers register for to get exactly this task."""
        return (self.type, self.name)

    def __hash__(self) -> int:
        return hash((self.type, self.name))

    @staticmethod
    def store_page(page: Page) -> Task:
        """Return the task that stores a page."""
        return Task(_STORE_PAGE, page.key, [page])

    def serialize(self) -> bytes:
        """Return the task as one line of JSON, exactly: float64, NaN and arrays survive."""
        return encode_value([self.type.value, self.name, self.val_list])

    @staticmethod
    def deserialize(data: bytes) -> Task:
        """Return the task that `serialize` wrote.

        Raises:
            TaskError: the bytes are not a task.
        """
        try:
            kind, name, val_list = decode_value(data, KINDS)
            if not (isinstance(name, str) and isinstance(val_list, list)):
                raise TypeError("a name is text, and values are in a list")
            return Task(TaskType(kind), name, val_list)
        except (ValueEncodingError, ValueError, TypeError) as error:
            raise TaskError(
                f"These bytes are not a task: {data!r:.80}", fix="they are [type, name, values] in JSON."
            ) from error


# What a handler may return: nothing, a task, or several, handled in that order.
SomeTasks: TypeAlias = Task | Sequence[Task] | None
TaskHandler: TypeAlias = Callable[[Task, TaskId], SomeTasks]
TaskHandlerMap: TypeAlias = dict[TaskId, TaskHandler]
