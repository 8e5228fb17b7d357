"""The student's side of lab 11: drives a queue of theirs, counts what it does, and puts it into a real node.

It stands in the student's process; what should have come the grader knows alone. Work is counted, not timed: every
comparison of priorities, and every place in the queue's own lists, dicts and deques that holds something else than
before. So the count is the same on any computer. A program that could reach this counter is found by reading it
(`plain_code.py`), and one that compares without being seen by the CPU time that the kernel counts.
"""

from __future__ import annotations

import gc
import math
import operator
from collections import deque
from collections.abc import Callable, Sequence
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import Config
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.lockstep import run_alone
from snr_sim.core.machine import EventMachine
from snr_sim.core.node import Node
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType

# What waits in the node of `run_node`, by kind: pages are stored before anything is made of them.
NODE_PRIORITIES = {TaskType.store_page: 20, TaskType.process_data: 10, TaskType.event: 0, TaskType.reload: 0}
MOST_STEPS = 5000


class Priority(int):
    """A priority that counts how often priorities are compared, and stays one when it is reckoned with."""

    compared = 0
    __hash__ = int.__hash__


def _counted(name: str) -> Callable[[int, Any], Any]:
    plain = getattr(int, name)

    def compare(self: int, other: Any) -> Any:
        Priority.compared += 1
        return plain(self, other)

    return compare


def _kept(name: str) -> Callable[..., Any]:
    plain = getattr(int, name)

    def reckon(self: int, *others: Any) -> Any:
        result = plain(self, *others)
        return Priority(result) if type(result) is int else result

    return reckon


for _name in ("__lt__", "__le__", "__gt__", "__ge__", "__eq__", "__ne__"):
    setattr(Priority, _name, _counted(_name))
for _name in ("__neg__", "__pos__", "__add__", "__radd__", "__sub__", "__rsub__", "__mul__", "__rmul__"):
    setattr(Priority, _name, _kept(_name))


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
        Priority.compared = written = 0
        before = self._contents(queue)
        for operation in operations[size:]:
            _done(queue, operation, Priority)
            now = self._contents(queue)
            written += _written(before, now)
            before = now
        return (Priority.compared + written) / (len(operations) - size)

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


def contents(*roots: Any, home: str = "") -> dict[int, tuple[Any, ...]]:
    """Returns what each list, dict, deque, set, object, function and generator holds that can be reached, by identity.

    The first item of each is the container itself, so that none of them goes away while it is compared.

    Args:
        roots: where to begin.
        home: name of the module whose classes and functions are looked into; those of others are not.
    """
    found: dict[int, tuple[Any, ...]] = {}
    waiting: list[Any] = list(roots)
    while waiting:
        one = waiting.pop()
        if type(one) in _PLAIN or isinstance(one, _OTHERS) or id(one) in found:
            continue
        if isinstance(one, (type, FunctionType)) and one.__module__ != home:
            continue
        inside = _inside(one)
        found[id(one)] = (one, *inside)
        waiting.extend(inside)
    return found


_PLAIN = {int, float, bool, str, bytes, Task, TaskType, Priority, type(None)}
_OTHERS = (ModuleType, BuiltinFunctionType, CodeType)
_KINDS: tuple[type[Any], ...] = (list, tuple, deque, set, frozenset)


def _inside(one: Any) -> Sequence[Any]:
    """Asks none of the student's own methods: an iterator of theirs could leave something out."""
    if isinstance(one, FunctionType):
        return [*(one.__closure__ or ()), *(one.__defaults__ or ()), *(one.__kwdefaults__ or {}).values()]
    items: list[Any] = []
    if isinstance(one, dict):
        items = [*dict.keys(one), *dict.values(one)]
    for kind in _KINDS:
        if isinstance(one, kind):
            items = list(kind.__iter__(one))
    if type(one) in (dict, *_KINDS):
        return items
    known = set(map(id, items))
    return [*items, *(other for other in gc.get_referents(one) if id(other) not in known)]


def _written(before: dict[int, tuple[Any, ...]], now: dict[int, tuple[Any, ...]]) -> int:
    """Returns how many places hold something else than before; all places of what is new."""
    return sum(_changed(before.get(identity, ()), holds) for identity, holds in now.items())


def _changed(held: tuple[Any, ...], holds: tuple[Any, ...]) -> int:
    """Returns in how many places one container changed."""
    if len(held) == len(holds) and not any(map(operator.is_not, held, holds)):
        return 0
    if held and isinstance(holds[0], (dict, set)):  # what is in them has no place that another could push it from
        return len(set(map(id, held)) ^ set(map(id, holds)))
    gone = 0
    if held and isinstance(holds[0], deque):  # what leaves at its front moves nobody
        gone = next((i for i, one in enumerate(held[1:]) if len(holds) > 1 and one is holds[1]), len(held) - 1)
        held = (held[0], *held[1 + gone :])
    return gone + sum(map(operator.is_not, held, holds)) + abs(len(holds) - len(held))


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
        self._queue.append(task)
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

    def get(self, parent: Node) -> Endpoint:
        """Returns a new one."""
        return _Answering(self, parent, "answering")


class _Answering(Endpoint):
    """Notes each task, and returns the tasks that a table says."""

    factory: _AnsweringFactory

    def __init__(self, factory: _AnsweringFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        kinds = (TaskType.event, TaskType.process_data, TaskType.terminate)
        self.task_handlers = dict.fromkeys(kinds, self.answer)

    def answer(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Answers a task."""
        self.factory.handled.append(task.name)
        return [_task(kind, name) for kind, name in self.factory.answers.get(task.name, ())]


class PlainQueue:
    """What a right queue answers, found the slow way: all tasks in one list, looked through at each operation.

    Args:
        most: how many tasks it may hold.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._waiting: list[tuple[float, Task]] = []

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, task: Task, priority: int) -> Task | None:
        """Lets a task in; returns the one that has to leave for it, if it is full."""
        self._waiting.append((math.inf if task.type is TaskType.terminate else priority, task))
        if len(self._waiting) <= self._most:
            return None
        least = min(range(len(self._waiting)), key=lambda i: self._waiting[i][0])  # the first of several: the oldest
        return self._waiting.pop(least)[1]

    def take(self) -> Task | None:
        """Returns the next task, or None."""
        if not self._waiting:
            return None
        return self._waiting.pop(max(range(len(self._waiting)), key=lambda i: self._waiting[i][0]))[1]
