"""The node's own endpoint, first of its components: it stores pages and ends the run."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from snr_sim.core.component import CORE_NAME
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.node_life import NodeLife
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.reload.reload import ComponentManager
from snr_sim.core.reload.rollback import Probations
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import TaskError
from snr_sim.prelude.page import DataKey, Page
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType

_PROCESS_DATA = TaskType.process_data  # looked up once, as in component.py


class NodeCore(Endpoint):
    """Endpoint that stores pages before any other component handles the task, and then schedules their processing.

    The page `reload`, `add_component` or `remove_component` has the outcome of such a task.
    """

    is_robot_component = False

    def __init__(self, parent: NodeParts, life: NodeLife) -> None:
        super().__init__(EndpointFactory(), parent, CORE_NAME)
        self._node = parent
        self._put = parent.datastore.put
        # Pages whose `process_data` task waits behind others, oldest first, each with the page of its key before it.
        # Tasks are executed in queue order, so entries in excess of the queue's length have been processed.
        self._waiting: deque[tuple[Page, Page | None]] = deque()
        self._own_name = parent.name
        self.received_s: dict[DataKey, float] = {}  # arrival time of the newest page of a key from other nodes
        # Callbacks by key: links send these pages on. Not part of the machine, so a replay has none.
        self.store_listeners: dict[DataKey, list[Callable[[Page], None]]] = {}
        manager = ComponentManager(life, self)
        self.task_handlers = {
            TaskType.store_page: self.store,
            TaskType.terminate: self.end_node,
            TaskType.reload: manager.reload,
            (TaskType.event, tasks.ADD_COMPONENT_TASK_NAME): manager.add_component,
            (TaskType.event, tasks.REMOVE_COMPONENT_TASK_NAME): manager.remove_component,
            (TaskType.event, tasks.REMOVE_ENDPOINT_TASK_NAME): manager.remove_component,
            (TaskType.event, tasks.ROLL_BACK_TASK_NAME): Probations(manager).roll_back,
            (TaskType.event, tasks.FINISH_TASK_NAME): self.finish,
        }

    def store(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Put the page in the datastore, and schedule its processing if it requests that."""
        values = task.val_list
        if not (values and isinstance(values, (list, tuple))):
            raise TaskError(
                f"The task store_page '{task.name}' carries {values or 'no page'!r}, not a list with a page.",
                fix="self.store_data_task(key, data).",
            )
        page = values[0]
        before = self._put(page)
        if page.origin != self._own_name:
            self.received_s[page.key] = self._node.machine.now_s
        if self.store_listeners:
            for listener in self.store_listeners.get(page.key, ()):
                listener(page)
        if not page.process:
            return None
        if self._node.machine.queue:  # else it is processed next, while it is still the newest
            self.await_processing(page, before)
        return Task(_PROCESS_DATA, page.key, [page])

    def await_processing(self, page: Page, before: Page | None) -> None:
        """Keep the page of the key that was stored before this one until this one has been processed."""
        queue, waiting = self._node.machine.queue, self._waiting
        waiting.append((page, before))
        while len(waiting) > len(queue) + 1:
            waiting.popleft()

    def page_before(self, page: Page) -> Page | None:
        """Return the page of the same key stored before `page`, whose `process_data` task is being executed."""
        return next((before for one, before in self._waiting if one is page), None)

    def end_node(self, task: Task, task_id: TaskId) -> SomeTasks:
        """End the node; the task's name is the reason."""
        if self._node.exit_reason is None:
            self._node.exit_reason = task.name
        self._node.machine.is_ended = True
        return None

    def finish(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Requeue the task as often as its second value states, then end the node."""
        reason, generations = task.val_list
        if generations > 0:
            return Task(task.type, task.name, [reason, generations - 1])
        return tasks.terminate(reason)
