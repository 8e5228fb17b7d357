"""The student's side of lab 11: drives a queue of theirs, counts how much work it does, and puts it into a real node.

It runs in the student's process, alone; only the grader knows the expected results (`plain_queue.py`).

Work is counted and not timed, so it is the same on any computer: every comparison of priorities, and every place in a
program's own lists, dicts and deques that holds something else than before. A program that could reach this counter is
found by reading it (`restricted_code.py`), and one that compares unseen by the CPU time that the kernel counts.
"""

from __future__ import annotations

import gc
import operator
from collections import deque
from collections.abc import Callable, Sequence
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

from snr_sim import Config, Endpoint, EndpointFactory, Node, SimClock, SomeTasks, Task, TaskId, TaskType
from snr_sim.core.lockstep import run_node
from snr_sim.core.machine import EventMachine
from snr_sim.errors import ParameterError

# Tasks that wait in the node of `run_node`, by kind: pages are stored before any handler runs.
NODE_PRIORITIES = {TaskType.store_page: 20, TaskType.process_data: 10, TaskType.event: 0, TaskType.reload: 0}
MAX_STEPS = 5000
Operations = Sequence[Sequence[Any]]  # ["put", kind of task, name, priority], ["take"] or ["len"]


class QueueBench:
    """Drives the class TaskQueue of a student's file.

    Raises:
        ParameterError: the file has no such class.
    """

    def __init__(self, module: Any) -> None:
        kind = getattr(module, "TaskQueue", None)
        if not isinstance(kind, type):
            raise ParameterError("The file has no class TaskQueue.", fix="keep the name that the starter has.")
        for name in ("put", "take", "__len__"):
            if not callable(getattr(kind, name, None)):
                raise ParameterError(f"TaskQueue has no method {name}().", fix="keep all that the starter has.")
        self.kind: Any = kind
        self._module = module
        self._queue: Any = None

    def answers(self, max_tasks: int, operations: Operations) -> list[Any]:
        """Return the results of operations on a queue for `max_tasks` tasks: the name of a task, None, or a number."""
        self._queue = self.kind(max_tasks)
        return self.more_answers(operations)

    def more_answers(self, operations: Operations) -> list[Any]:
        """Return the results of more operations on the queue used last."""
        return [_done(self._queue, operation, int) for operation in operations]

    def work(self, size: int, operations: Operations) -> float:
        """Return how much work one operation is on average, beginning when `size` of them have filled the queue."""
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

    def places(self, max_tasks: int, operations: Operations) -> int:
        """Return how many places the queue's own lists, dicts and deques have after some operations."""
        queue = self.kind(max_tasks)
        for operation in operations:
            _done(queue, operation, int)
        return sum(len(one) for one in self._contents(queue).values())

    def _contents(self, queue: Any) -> dict[int, tuple[Any, ...]]:
        own = [value for name, value in vars(self._module).items() if name[:2] != "__"]
        return contents(queue, *own, home=getattr(self._module, "__name__", ""))

    def run_node(
        self, max_tasks: int, answers: dict[str, list[list[str]]], first: Sequence[Sequence[str]]
    ) -> dict[str, list[str]]:
        """Run a real node whose tasks wait in a queue of the student's; return what it handled and what was dropped.

        Args:
            max_tasks: how many tasks the queue may hold.
            answers: for the name of a task, the [kind, name] of each task that its handler returns.
            first: [kind, name] of tasks that enter from outside before the node runs.
        """
        factory = _AnsweringFactory(answers)
        node = Node("bench", Config(factories={"bench": [factory]}), clock=SimClock())
        node.machine = machine = QueuedMachine(node.machine, self.kind(max_tasks))
        for kind, name in first:
            node.enqueue_input(Task(TaskType(kind), name), "grader")
        run_node(node)
        return {"handled": factory.handled, "dropped": machine.dropped}


def _done(queue: Any, operation: Sequence[Any], priority_of: Callable[[int], int]) -> Any:
    if operation[0] == "put":
        _, kind, name, priority = operation
        return _name_of(queue.put(Task(TaskType(kind), name), priority_of(priority)), "put")
    return _name_of(queue.take(), "take") if operation[0] == "take" else len(queue)


def _name_of(answer: Any, method: str) -> str | None:
    if answer is None:
        return None
    if type(answer) is not Task:
        raise ParameterError(f"{method}() returned {answer!r}.", fix="a task, or None if there is none.")
    return answer.name


# -- in a node --------------------------------------------------------------------------------------------------------


class QueuedMachine(EventMachine):
    """The node's machine with a queue of the student's in the place of its own two."""

    def __init__(self, machine: EventMachine, queue: Any) -> None:
        super().__init__(machine.lookup, machine.inbox, None)
        self.dropped: list[str] = []
        self._student = queue

    @property
    def queue_length(self) -> int:
        """How many tasks wait that have been let in."""
        return len(self._student)

    @property
    def queued(self) -> int:
        """Number of tasks that wait, in the inbox or in the queue."""
        return self.queue_length + len(self.inbox.waiting)

    def run_ready(self) -> None:
        """Execute tasks until none is left or the machine has ended."""
        while not self.is_ended:
            if self.inbox.waiting:
                self.accept_inputs()
            if not self.queue_length:
                return
            self.execute_next()

    def execute_next(self) -> None:
        """Execute the next task of the queue."""
        if self.executed >= MAX_STEPS:
            raise ParameterError("The node has no end: take() gives tasks that were given before, or len() is wrong.")
        task = self._student.take()
        if type(task) is not Task:
            raise ParameterError(f"take() returned {task!r} while len() was more than 0.", fix="the next task.")
        self.queue.append(task)
        super().execute_next()

    def _enqueue(self, task: Task, source: str) -> None:
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

    def __init__(self, answers: dict[str, list[list[str]]]) -> None:
        super().__init__()
        self.answers, self.handled = answers, list[str]()

    def get(self, parent: Node) -> Endpoint:
        """Return a new one."""
        return _Answering(self, parent, "answering")


class _Answering(Endpoint):
    """Notes each task, and returns its follow-up tasks from a table."""

    factory: _AnsweringFactory

    def __init__(self, factory: _AnsweringFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        kinds = (TaskType.event, TaskType.process_data, TaskType.terminate)
        self.task_handlers = dict.fromkeys(kinds, self.answer)

    def answer(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Answer a task."""
        self.factory.handled.append(task.name)
        return [Task(TaskType(kind), name) for kind, name in self.factory.answers.get(task.name, ())]


# -- work -------------------------------------------------------------------------------------------------------------


class Priority(int):
    """A priority that counts comparisons of priorities; arithmetic on one gives another."""

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

    def compute(self: int, *others: Any) -> Any:
        result = plain(self, *others)
        return Priority(result) if type(result) is int else result

    return compute


for _name in ("__lt__", "__le__", "__gt__", "__ge__", "__eq__", "__ne__"):
    setattr(Priority, _name, _counted(_name))
for _name in ("__neg__", "__pos__", "__add__", "__radd__", "__sub__", "__rsub__", "__mul__", "__rmul__"):
    setattr(Priority, _name, _kept(_name))

_PLAIN = {int, float, bool, str, bytes, Task, TaskType, Priority, type(None)}
_OTHERS = (ModuleType, BuiltinFunctionType, CodeType)
_KINDS: tuple[type[Any], ...] = (list, tuple, deque, set, frozenset)


def contents(*roots: Any, home: str = "") -> dict[int, tuple[Any, ...]]:
    """Return the contents of each reachable list, dict, deque, set, object, function and generator, by identity.

    The first item of each is the container itself, so that none of them is freed while it is compared.

    Args:
        roots: where to begin.
        home: name of the module whose classes and functions are looked into; those of others are not.
    """
    found: dict[int, tuple[Any, ...]] = {}
    waiting = list(roots)
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


def _inside(one: Any) -> Sequence[Any]:
    """Ask none of the student's own methods: an iterator of theirs could leave something out."""
    if isinstance(one, FunctionType):
        return [*(one.__closure__ or ()), *(one.__defaults__ or ()), *(one.__kwdefaults__ or {}).values()]
    items = [*dict.keys(one), *dict.values(one)] if isinstance(one, dict) else []
    for kind in _KINDS:
        if isinstance(one, kind):
            items = list(kind.__iter__(one))
    if type(one) in (dict, *_KINDS):
        return items
    known = set(map(id, items))
    return [*items, *(other for other in gc.get_referents(one) if id(other) not in known)]


def written(before: dict[int, tuple[Any, ...]], now: dict[int, tuple[Any, ...]]) -> int:
    """Return how many places contain something else than before; all places of new containers."""
    return sum(_changed(before.get(identity, ()), holds) for identity, holds in now.items())


def _changed(held: tuple[Any, ...], holds: tuple[Any, ...]) -> int:
    """Return in how many places one container changed."""
    if len(held) == len(holds) and not any(map(operator.is_not, held, holds)):
        return 0
    if held and isinstance(holds[0], (dict, set)):  # an entry of these has no position that another could shift
        return len(set(map(id, held)) ^ set(map(id, holds)))
    gone = 0
    if held and isinstance(holds[0], deque):  # removal at its front shifts no other entry
        gone = next((i for i, one in enumerate(held[1:]) if len(holds) > 1 and one is holds[1]), len(held) - 1)
        held = (held[0], *held[1 + gone :])
    return gone + sum(map(operator.is_not, held, holds)) + abs(len(holds) - len(held))
