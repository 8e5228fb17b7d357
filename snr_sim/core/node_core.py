"""The node's own endpoint, first of its components: it handles the tasks that store pages, change or end the node."""

from __future__ import annotations

from snr_sim.core.component import CORE_NAME
from snr_sim.core.datastore import PageStorage
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.node_life import NodeLife
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.reload.reload import ComponentManager
from snr_sim.core.reload.rollback import Probations
from snr_sim.prelude import tasks
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType


class NodeCore(Endpoint):
    """Endpoint that stores pages before any other component handles the task, and then schedules their processing.

    The page `reload`, `add_component` or `remove_component` has the outcome of such a task.
    """

    is_robot_component = False

    def __init__(self, parent: NodeParts, life: NodeLife, storage: PageStorage) -> None:
        super().__init__(EndpointFactory(), parent, CORE_NAME)
        self._node = parent
        manager = ComponentManager(life, self)
        probations = Probations(manager)
        self.task_handlers = {
            TaskType.store_page: storage.store,
            TaskType.terminate: self.end_node,
            TaskType.reload: manager.reload,
            (TaskType.event, tasks.ADD_COMPONENT_TASK_NAME): manager.add_component,
            (TaskType.event, tasks.REMOVE_COMPONENT_TASK_NAME): manager.remove_component,
            (TaskType.event, tasks.REMOVE_ENDPOINT_TASK_NAME): manager.remove_component,
            (TaskType.event, tasks.ROLL_BACK_TASK_NAME): probations.roll_back,
            (TaskType.event, tasks.FAILED_CALL_TASK_NAME): probations.end_failed_call,
            (TaskType.event, tasks.FINISH_TASK_NAME): self.finish,
        }

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
