"""Interface of a node for its components: tasks, pages, time, randomness, notes. Implemented by `core/node.py`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from typing import TYPE_CHECKING, Any, Protocol

from snr_sim.prelude.clock import Clock
from snr_sim.prelude.component import Component, RoleName
from snr_sim.prelude.errors import ComponentFailedError, SnrError
from snr_sim.prelude.task import DataKey, Page, SomeTasks, Task, TaskName, TaskType

if TYPE_CHECKING:
    import numpy as np


class PageStore(Protocol):
    """The newest page of each key."""

    pages: dict[DataKey, Page]

    def get(self, key: DataKey) -> Page | None:
        """Return the newest page of a key, or None."""


class TaskInbox(Protocol):
    """Thread-safe inbox of tasks from outside the node.

    Attributes:
        wait_count: how often the node has waited for it.
    """

    wait_count: int

    @property
    def waiting(self) -> Sized:
        """Tasks that the node has not taken yet."""

    @property
    def is_waiting(self) -> bool:
        """Whether the node's thread waits for it now."""

    def put(self, task: Task, source: str) -> None:
        """Add a task; `source` is the name of its sender."""

    def fail(self, failure: SnrError) -> None:
        """Report a failure outside the node's thread; the first one ends the node."""

    def watch(self, descriptor: int, serve: Callable[[list[Any]], None], what: Any) -> None:
        """Call `serve` on the node's thread when a descriptor can be read while the node waits."""

    def unwatch(self, descriptor: int) -> None:
        """Remove a descriptor that `watch` added."""


class NodeApi(Protocol):
    """A node, as its components see it.

    Attributes:
        name: of the node, such as "urov_node".
        role: which of the config's roles it runs.
        clock: wall time, or virtual time in lock step.
        seed: of the run.
        component_seed: seed that the random generators of its components are derived from.
        is_in_lock_step: whether its clock is virtual.
        is_replay: whether a recorded run is repeated: no file may be written then, and no page sent.
        exit_reason: of the first terminate task, once there has been one.
        never_ran: whether an error ended it at its start: a condition that it waited for could not be met.
    """

    name: str
    role: RoleName
    clock: Clock
    seed: int
    component_seed: int
    is_in_lock_step: bool
    is_replay: bool
    exit_reason: str | None
    never_ran: bool

    @property
    def components(self) -> Mapping[str, Component]:
        """Components by name."""

    @property
    def factories(self) -> Sequence[Any]:
        """Factories that its role has in the config; those of loops also in a replay, where no loop is made of them."""

    @property
    def datastore(self) -> PageStore:
        """Newest pages."""

    @property
    def inbox(self) -> TaskInbox:
        """Inbox of tasks from outside."""

    @property
    def queued_task_count(self) -> int:
        """Number of tasks in the queue."""

    @property
    def is_finished(self) -> bool:
        """Whether the end of the run has begun."""

    @property
    def is_terminated(self) -> bool:
        """Whether a terminate task has been executed."""

    @property
    def rng(self) -> np.random.Generator:
        """Random generator of the component that runs."""

    # Tasks

    def schedule(self, tasks: SomeTasks, source: str = "outside") -> None:
        """Queue tasks: as the running handler's, or as an input if no handler runs."""

    def enqueue_input(self, tasks: SomeTasks, source: str) -> None:
        """Queue tasks as inputs, from any thread; `source` is the name of their sender."""

    def seen_tasks(self) -> Mapping[TaskType, Mapping[TaskName, Any]]:
        """Return by type and name all tasks that were executed, with their handlers."""

    def handlers_changed(self) -> None:
        """Update the handlers after a change."""

    def start_loop(self, loop: Any, on_thread: bool = False) -> None:
        """Start the ticks of a loop of this node.

        By the virtual clock in lock step, else on a thread or in a process, as the loop declares, or `on_thread`.
        """

    # Data

    def page(self, key: DataKey, data: Any, process: bool = True) -> Page:
        """Return a page made by this node, now, with a copy of the data."""

    def store_page(self, page: Page) -> None:
        """Queue the task that stores a page."""

    def store_data_task(self, key: DataKey, data: Any, process: bool = True) -> Task:
        """Return the task that stores data under a key."""

    def get_page(self, key: DataKey) -> Page | None:
        """Return the newest page of a key, or None; in a handler of process_data the page of its task."""

    def get_age_s(self, key: DataKey) -> float:
        """Return the age of the page of `get_page` [s]; infinite if that is not known."""

    def received_at_s(self, key: DataKey) -> float:
        """Return when the newest page of a key from another node arrived [s]; -inf if none did."""

    def add_store_listener(self, key: DataKey, callback: Callable[[Page], None]) -> None:
        """Call `callback` with each page of a key right after it is stored, on the node's thread."""

    def remove_store_listener(self, key: DataKey, callback: Callable[[Page], None]) -> None:
        """Remove a callback that `add_store_listener` added."""

    def find_writer(self, key: DataKey, reader: str) -> tuple[str, str, tuple[str, ...]]:
        """Return the lines that could have stored a page, a text that names their owners, and the owners' names.

        The component `reader`, which asks since the page is invalid, is left out.
        """

    def blame_suspects(self, failure: ComponentFailedError) -> bool:
        """Undo new code that may have caused another's failure, which continues; return whether there is such code."""

    # Time, notes

    def get_time_s(self) -> float:
        """Return the time latched for the running task, or else the clock's [s]."""

    def add_note(self, text: str, lines: str = "", *, is_recorded: bool = True) -> None:
        """Add a note to the run diagnostics, once; `lines` are the related lines of the student's code.

        What depends on the wall clock in lock step, too, is not recorded: it would change the trace.
        """

    def note_object(self, key: DataKey, kind: type) -> bool:
        """Return whether a page of this key held an object of this class for the first time."""

    def record_text(self, component: str, level: str, text: str) -> None:
        """Record a text that a component has printed or logged."""
