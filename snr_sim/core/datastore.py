"""Pages of a node: the newest of each key, the one before it under `<key>_prev`, their storing and their age.

On the wall clock each node counts from its own start, so `created_at_s` of another node's page is not comparable with
local time. A link knows the offset between the clocks of its two ends and stores it in its state page. That page is
recorded like any other, so a replay computes the same age.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from snr_sim.core.handlers import check_task
from snr_sim.core.machine import EventMachine
from snr_sim.prelude.errors import TaskError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey, Page, SomeTasks, Task, TaskId, TaskType

PREVIOUS = "_prev"
LINK_PREFIX = "link_"
_PROCESS_DATA = TaskType.process_data  # looked up once, as in component.py


class Datastore:
    """Pages by key. Written on the node's thread only; read from any.

    >>> store = Datastore()
    >>> store.put(Page("depth", 1.0, "urov_node", 0.0))
    >>> store.put(Page("depth", 2.0, "urov_node", 0.1)).data
    1.0
    >>> store.get("depth").data, store.get("depth_prev").data, store.get("heading")
    (2.0, 1.0, None)
    """

    def __init__(self) -> None:
        self.pages: dict[DataKey, Page] = {}
        self.previous: dict[DataKey, Page] = {}
        self.missed: dict[DataKey, None] = {}  # requested too early, in order; reported if never stored
        self.stored: int = 0
        self.received_s: dict[DataKey, float] = {}  # arrival time of the newest page of a key from other nodes
        # Callbacks by key: links send these pages on. Not part of the machine, so a replay has none.
        self.listeners: dict[DataKey, list[Callable[[Page], None]]] = {}

    def put(self, page: Page) -> Page | None:
        """Make `page` the newest of its key; return the previous newest, if any.

        Raises:
            TaskError: it is not a page, or its key is not text.
        """
        try:
            key = page.key
            old = self.pages.get(key)
        except (AttributeError, TypeError):
            raise _not_a_page(page) from None
        if old is not None:
            self.previous[key] = old
        elif not isinstance(key, str):
            raise _not_a_page(page)
        self.pages[key] = page
        self.stored += 1
        return old

    def get(self, key: DataKey) -> Page | None:
        """Return the newest page of the key, or None if nothing has stored it (yet)."""
        page = self.pages.get(key)
        if page is None and isinstance(key, str) and key.endswith(PREVIOUS):
            key = key.removesuffix(PREVIOUS)
            page = self.previous.get(key)
            if page is None and key in self.pages:
                return None  # only one page so far, which is not an error
        if page is None:
            self.missed[key] = None
        return page


class PageStorage:
    """Handles `store_page` tasks: stores each page and schedules its processing.

    Args:
        node: name of the node.
        machine, datastore: of the node.
    """

    def __init__(self, node: str, machine: EventMachine, datastore: Datastore) -> None:
        self._own_name = node
        self._machine = machine
        self._put = datastore.put
        self._received_s = datastore.received_s
        self._listeners = datastore.listeners
        # Pages whose `process_data` task waits behind others, oldest first, each with the page of its key before it.
        # Tasks are executed in queue order, so entries in excess of the queue's length have been processed.
        self._waiting: deque[tuple[Page, Page | None]] = deque()

    def store(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Put the page in the datastore, and schedule its processing if it requests that."""
        values = task.val_list
        if not (values and isinstance(values, (list, tuple))):
            raise _without_page(task)
        page = values[0]
        before = self._put(page)
        if page.origin != self._own_name:
            self._received_s[page.key] = self._machine.now_s
        if self._listeners:
            for listener in self._listeners.get(page.key, ()):
                listener(page)
        if not page.process:
            return None
        if self._machine.queue:  # else it is processed next, while it is still the newest
            self.await_processing(page, before)
        return Task(_PROCESS_DATA, page.key, [page])

    def await_processing(self, page: Page, before: Page | None) -> None:
        """Keep the page of the key that was stored before this one until this one has been processed."""
        queue, waiting = self._machine.queue, self._waiting
        waiting.append((page, before))
        while len(waiting) > len(queue) + 1:
            waiting.popleft()

    def page_before(self, page: Page) -> Page | None:
        """Return the page of the same key stored before `page`, whose `process_data` task is being executed."""
        return next((before for one, before in self._waiting if one is page), None)


def check_executable(task: Task) -> None:
    """Raise a TaskError unless a node can execute a task, and store its page if it is to."""
    check_task(task)
    if task.type is not TaskType.store_page:
        return
    if not task.val_list:
        raise _without_page(task)
    page: Any = task.val_list[0]
    if not (type(page) is Page and isinstance(page.key, str)):
        raise _not_a_page(page)


def _without_page(task: Task) -> TaskError:
    return TaskError(
        f"The task store_page '{task.name}' carries no page.", fix="self.store_data_task(key, data) makes a right one."
    )


def _not_a_page(page: Any) -> TaskError:
    if type(page) is Page:
        return TaskError(f"A page has the key {page.key!r}, which is not text.", fix="give it a name: 'depth'.")
    return TaskError(
        f"A store_page task carries {page!r}, which is not a page.",
        fix="self.store_data_task(key, data) makes a right one.",
    )


def page_age_s(node: NodeApi, page: Page) -> float:
    """Return the age of a page [s]; if uncertain, an upper bound.

    On the wall clock, the age of another node's page is infinite if no link knows that node's clock, since a command of
    unknown age must not count as fresh. The age is at least the time since the page arrived, which this node's own
    clock measures even if the other program has ended.
    """
    now_s = node.get_time_s()
    if page.origin == node.name:
        return now_s - page.created_at_s
    here_s = now_s - node.received_at_s(page.key)
    offset_s = 0.0 if node.is_in_lock_step else clock_offset_s(node, page.origin)
    return max(here_s, now_s - page.created_at_s - offset_s)


def clock_offset_s(node: NodeApi, far: str) -> float:
    """Return the offset from the far node's clock to ours [s], as measured by our links; -inf if none has.

    If several nodes have that name, return the smallest offset: an age is then too large rather than too small.
    """
    offsets_s = [
        peer["clock_offset_s"]
        for key, page in node.datastore.pages.copy().items()
        # A page with such a key from a far end is not the state of a link of this node.
        if key.startswith(LINK_PREFIX) and page.origin == node.name
        for name, peer in _peers_in(page.data)
        if (name == far or str(name).startswith(f"{far}#")) and isinstance(peer, dict)
        if isinstance(peer.get("clock_offset_s"), float)
    ]
    return min(offsets_s, default=-math.inf)


def _peers_in(state: Any) -> Iterable[tuple[Any, Any]]:
    """Return name and state of each peer in a link's page; nothing if the page has another format."""
    peers = state.get("peers") if isinstance(state, dict) else None
    return peers.items() if isinstance(peers, dict) else ()
