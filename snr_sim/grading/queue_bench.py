"""The student's side of lab 11: drives a queue of theirs, tells how much work it does, and puts it into a real node.

It stands in the student's process; what should have come (`plain_queue.py`) the grader knows alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import Config
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.lockstep import run_alone
from snr_sim.core.machine import EventMachine
from snr_sim.core.node import Node
from snr_sim.grading.queue_work import Priority, contents, written
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType

# What waits in the node of `run_node`, by kind: pages are stored before anything is made of them.
NODE_PRIORITIES = {TaskType.store_page: 20, TaskType.process_data: 10, TaskType.event: 0, TaskType.reload: 0}
MOST_STEPS = 5000


class QueueBench:
    """Drives the class TaskQueue of a student's file.

    Args:
        module: the file.

    Raises:
        ParameterError: it has no such class.
    """

    def __init__(self, module: ModuleType) -> None:
        kind = getattr(module, "TaskQueue", None)
        if not isinstance(kind, type):
            raise ParameterError("The file has no class TaskQueue.", fix="keep the name that the starter has.")
        for name in ("put", "take", "__len__"):
            if not callable(getattr(kind, name, None)):
                raise ParameterError(f"TaskQueue has no method {name}().", fix="keep all that the starter has.")
        self.kind: Any = kind
        self._module = module
        self._queue: Any = None

    def answers(self, most: int, operations: Sequence[Sequence[Any]]) -> list[Any]:
        """Returns what a queue answers to some operations: the name of a task, None, or a number.

        Args:
            most: how many tasks it may hold.
            operations: ["put", kind of task, name, priority], ["take"] or ["len"].
        """
        self._queue = self.kind(most)
        return self.more_answers(operations)

    def more_answers(self, operations: Sequence[Sequence[Any]]) -> list[Any]:
        """Returns what the queue that has answered last answers to more operations."""
        return [_done(self._queue, operation, int) for operation in operations]

    def work(self, size: int, operations: Sequence[Sequence[Any]]) -> float:
        """Returns how much work one operation is on average, beginning when `size` of them have filled the queue."""
        queue = self.kind(size)
        for operation in operations[:size]:
            _done(queue, operation, Priority)
        Priority.compared = places = 0
        before = self._contents(queue)
        for operation in operations[size:]:
            _done(queue, operation, Priority)
            now = self._contents(queue)
            places += written(before, now)
            before = now
        return (Priority.compared + places) / (len(operations) - size)

    def places(self, most: int, operations: Sequence[Sequence[Any]]) -> int:
        """Returns how many places the queue's own lists, dicts and deques have after some operations."""
        queue = self.kind(most)
        for operation in operations:
            _done(queue, operation, int)
        return sum(len(one) for one in self._contents(queue).values())

    def _contents(self, queue: Any) -> dict[int, tuple[Any, ...]]:
        own = [value for name, value in vars(self._module).items() if name[:2] != "__"]
        return contents(queue, *own, home=getattr(self._module, "__name__", ""))

    def run_node(
        self, most: int, answers: dict[str, list[list[str]]], first: Sequence[Sequence[str]]
    ) -> dict[str, list[str]]:
        """Runs a real node whose tasks wait in a queue of the student's; returns what was handled, in order.

        Args:
            most: how many tasks the queue may hold.
            answers: for the name of a task, the [kind, name] of each task that its handler returns.
            first: tasks that enter through the door before the node runs.
        """
        handled: list[str] = []
        config = Config(factories={"bench": [_AnsweringFactory(answers, handled)]})
        node = Node("bench", config, clock=SimClock())
        machine = QueuedMachine(node.machine, self.kind(most))
        node.machine = machine
        for kind, name in first:
            node.enter(_task(kind, name), "grader")
        run_alone(node)
        return {"handled": handled, "dropped": machine.dropped}


def _done(queue: Any, operation: Sequence[Any], priority_of: Callable[[int], int]) -> Any:
    if operation[0] == "put":
        _, kind, name, priority = operation
        gone = queue.put(_task(kind, name), priority_of(priority))
        return _name_of(gone, "put")
    if operation[0] == "take":
        return _name_of(queue.take(), "take")
    return len(queue)


def _task(kind: str, name: str) -> Task:
    return Task(TaskType(kind), name)


def _name_of(answer: Any, method: str) -> str | None:
    if answer is None:
        return None
    if type(answer) is not Task:
        raise ParameterError(f"{method}() returned {answer!r}.", fix="a task, or None if there is none.")
    return answer.name


class QueuedMachine(EventMachine):
    """The node's machine with a queue of the student's in the place of its own two.

    Args:
        machine: that it takes the place of.
        queue: the student's.
    """

    def __init__(self, machine: EventMachine, queue: Any) -> None:
        super().__init__(machine.lookup, machine.door, None)
        self.dropped: list[str] = []
        self._student: Any = queue

    @property
    def inside(self) -> int:
        """How many tasks wait that have been let in."""
        return len(self._student)

    @property
    def queued(self) -> int:
        """How many tasks wait, at the door or inside."""
        return self.inside + len(self.door.waiting)

    def run_ready(self) -> None:
        """Executes tasks until none is left or the machine has ended."""
        while not self.is_ended:
            if self.door.waiting:
                self.let_in()
            if not self.inside:
                return
            self.execute_next()

    def execute_next(self) -> None:
        """Executes the task that the queue gives next."""
        if self.executed >= MOST_STEPS:
            raise ParameterError("The node has no end: take() gives tasks that were given before, or len() is wrong.")
        task = self._student.take()
        if type(task) is not Task:
            raise ParameterError(f"take() returned {task!r} while len() was more than 0.", fix="the next task.")
        self.queue.append(task)
        super().execute_next()

    def _enter(self, task: Task, source: str) -> None:
        self._put(task)

    def _queue_all(self, tasks: Sequence[Task]) -> None:
        for task in tasks:
            self._put(task)

    def _put(self, task: Task) -> None:
        gone = _name_of(self._student.put(task, NODE_PRIORITIES.get(task.type, 0)), "put")
        if gone is not None:
            self.dropped.append(gone)


class _AnsweringFactory(EndpointFactory):
    """Makes the endpoint that answers by a table."""

    def __init__(self, answers: dict[str, list[list[str]]], handled: list[str]) -> None:
        super().__init__()
        self.answers, self.handled = answers, handled

    def get(self, parent: NodeApi) -> Endpoint:
        """Returns a new one."""
        return _Answering(self, parent, "answering")


class _Answering(Endpoint):
    """Notes each task, and returns the tasks that a table says."""

    factory: _AnsweringFactory

    def __init__(self, factory: _AnsweringFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        kinds = (TaskType.event, TaskType.process_data, TaskType.terminate)
        self.task_handlers = dict.fromkeys(kinds, self.answer)

    def answer(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Answers a task."""
        self.factory.handled.append(task.name)
        return [_task(kind, name) for kind, name in self.factory.answers.get(task.name, ())]
