"""Expectors: the tasks that a test expects, counted or in order, and a message about those that came instead.

An endpoint in the node under test passes each expected task to an expector.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from types import GenericAlias, TracebackType
from typing import Any, Self, TypeAlias
from unittest import TestCase

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.handlers import check_id, describe
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError, suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.retired import Retired
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskName, TaskType

Expected: TypeAlias = TaskId | str  # a task, or a call of a test's own
TaskExpectations: TypeAlias = Mapping[Any, int] | Sequence[Expected]
_SATISFIED = "expector satisfied"
_SHOWN = 20  # of a long list: more does not help the reader


class Expectations:
    """Common part of both expectors: used in a `with`, they check at its end, unless the block raised.

    Args:
        expected: the expected ids: of tasks, which an `ExpectorEndpointFactory` passes on, or texts of the test's
            own, which `call` counts.
        case: the test it belongs to, whose failure exception is raised; without one, an AssertionError.
    """

    def __init__(self, expected: Iterable[Expected], case: TestCase | None) -> None:
        self.ids: list[Any] = list(dict.fromkeys(expected))
        for task_id in self.ids:
            if not isinstance(task_id, str):
                check_id("expector", task_id)
        self._failure = case.failureException if case is not None else AssertionError
        self._other_tasks: dict[TaskType, set[TaskName]] = {kind: set() for kind in TaskType}
        # By a node that has run, or by a task passed to it; calls come from the test itself.
        self.was_used: bool = any(type(one) is str for one in self.ids)

    check: Any = Retired("expector.check", "expector.is_satisfied().")
    get_expectations: Any = Retired("expector.get_expectations", "expector.ids.")
    times_called: Any = Retired("expector.times_called", "expector.counts.")
    met_expectations: Any = Retired("expector.met_expectations", "expector.came.")

    def __class_getitem__(cls, kind: object) -> GenericAlias:  # Expector[str](...), as the thesis writes it
        return GenericAlias(cls, kind)

    def on_task(self, task: Task) -> None:
        """Take note of a task."""
        raise NotImplementedError(f"{type(self).__name__} needs a method on_task(self, task)")

    def call(self, name: Expected) -> None:
        """Count a call of the test's own, for events without a task: `expector.call("halted")`."""
        raise NotImplementedError(f"{type(self).__name__} needs a method call(self, name)")

    def is_satisfied(self) -> bool:
        """Return whether exactly the expected tasks have come so far."""
        return not self.failures()

    def failures(self) -> list[str]:
        """Return a sentence for each difference between expected and actual tasks."""
        raise NotImplementedError(f"{type(self).__name__} needs a method failures(self)")

    def assert_satisfied(self) -> None:
        """Fail if any task did not come as expected; the message lists each difference.

        Raises:
            AssertionError: or the failure exception of the test case.
        """
        failures = self.failures()
        if not self.was_used:
            failures.append(
                "This expector was not in a node that ran, so it received no tasks.\n"
                "  Try: add ExpectorEndpointFactory(expector) to its factories, and run the node in the `with` block."
            )
        if failures:
            raise self._failure("The expected tasks did not arrive:\n  " + "\n  ".join(failures))

    def add_other_tasks(self, kind: TaskType, names: Iterable[TaskName]) -> None:
        """Add names of tasks seen in the node, handled or not: suggestions for an expected name that did not come."""
        self._other_tasks[kind].update(names)

    def _instead(self, task_id: Expected) -> str:
        """Return a text about what came instead of an id that did not come at all."""
        if not isinstance(task_id, tuple):
            return ""
        kind, name = task_id
        seen = self._other_tasks[kind]
        return f"; {suggest(name, seen, f'every {kind.value} that came')}" if seen else ""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:  # an exception in the `with` is the cause; missing tasks would only follow from it
            self.assert_satisfied()


class Expector(Expectations):
    """Expector that counts tasks.

    Args:
        expected: how often each id must come: `{(TaskType.event, "landed"): 1, TaskType.store_page: 3}`. Or a list,
            which contains an id as often as it must come. An id with count 0 must not come.
        case: the test it belongs to, whose failure exception is raised; without one, an AssertionError.

    >>> with Expector({(TaskType.event, "landed"): 1}) as expector:
    ...     expector.on_task(Task(TaskType.event, "landed"))
    """

    def __init__(self, expected: TaskExpectations, case: TestCase | None = None) -> None:
        counts: dict[Expected, int] = dict(expected) if isinstance(expected, Mapping) else dict(Counter(expected))
        for task_id, count in counts.items():
            if not isinstance(count, int) or count < 0:
                raise ParameterError(f"Expector got {count!r} as the count of {task_id!r}.", fix="0, 1, 2, ...")
        super().__init__(counts, case)
        self.expected: dict[Expected, int] = counts
        self.counts: Counter[Expected] = Counter()

    def on_task(self, task: Task) -> None:
        """Count a task under its own id and under its type, where they are expected."""
        self.call(task.id())
        self.call(task.type)

    def call(self, name: Expected) -> None:
        """Count a call, if it is expected."""
        self.was_used = True
        if name in self.expected:
            self.counts[name] += 1

    def failures(self) -> list[str]:
        """Return a line for each count that is not as expected."""
        return [
            f"{_shown(task_id)}: expected {count}, came {self.counts[task_id]}"
            + ("" if self.counts[task_id] else self._instead(task_id))
            for task_id, count in self.expected.items()
            if self.counts[task_id] != count
        ]


class OrderedExpector(Expectations):
    """Checks the order in which tasks come; tasks with an id that is not in the list may come between them.

    Args:
        expected: ids, in order.
        case: the test it belongs to.
    """

    was_used: bool

    def __init__(self, expected: Sequence[Expected], case: TestCase | None = None) -> None:
        super().__init__(expected, case)
        self.expected: list[Expected] = list(expected)
        self.came: list[Expected] = []

    def on_task(self, task: Task) -> None:
        """Count a task, if its id or its type is expected anywhere."""
        self.was_used = True
        if task.id() in self.ids or task.type in self.ids:
            self.came.append(task.id())

    def call(self, name: Expected) -> None:
        """Count a call, if it is expected anywhere."""
        self.was_used = True
        if name in self.ids:
            self.came.append(name)

    def failures(self) -> list[str]:
        """Return the first position where the order differs, and both orders."""
        place = self._first_difference()
        if place is None:
            return []
        expected_id = self.expected[place] if place < len(self.expected) else None
        got = _shown(self.came[place]) if place < len(self.came) else "nothing more"
        expected = _shown(expected_id) if expected_id is not None else "nothing more"
        hint = self._instead(expected_id) if expected_id is not None and expected_id not in self.came else ""
        return [
            f"number {place + 1}: expected {expected}, came {got}{hint}",
            f"expected order: {_listed(self.expected)}",
            f"order that came: {_listed(self.came)}",
        ]

    def _first_difference(self) -> int | None:
        for place, (expected_id, got) in enumerate(zip(self.expected, self.came, strict=False)):
            if expected_id != got and not (isinstance(got, tuple) and expected_id == got[0]):
                return place
        shorter = min(len(self.expected), len(self.came))
        return None if len(self.expected) == len(self.came) else shorter


class ExpectorEndpointFactory(EndpointFactory):
    """Factory of an endpoint that puts an expector into a node.

    Args:
        expector: receives the tasks.
        name: of the endpoint.
        exit_when_satisfied: ends the node as soon as all expected tasks have come; later ones are not counted.

    Raises:
        ConfigError: the expector expects something that is not a task.
    """

    def __init__(self, expector: Expectations, name: str = "expector", exit_when_satisfied: bool = False) -> None:
        super().__init__()
        for task_id in expector.ids:
            check_id("expector", task_id)  # raises for a text: `call` counts those, which the test calls itself
        self.expector: Expectations = expector
        self.name = name
        self.exit_when_satisfied: bool = exit_when_satisfied

    def get(self, parent: NodeApi) -> ExpectorEndpoint:
        """Return the endpoint."""
        return ExpectorEndpoint(self, parent, self.name)


class ExpectorEndpoint(Endpoint):
    """Endpoint with handlers for the expected tasks only, so that the run's own notes do not change."""

    factory: ExpectorEndpointFactory

    def __init__(self, factory: ExpectorEndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self._is_done = False
        self.task_handlers = dict.fromkeys(factory.expector.ids, self.on_task)

    def begin(self) -> None:
        """Mark the expector as used in a node that runs."""
        self.factory.expector.was_used = True

    def on_task(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Pass the task to the expector."""
        if self._is_done:
            return None
        expector = self.factory.expector
        expector.on_task(task)
        if self.factory.exit_when_satisfied and expector.is_satisfied():
            self._is_done = True
            return tasks.terminate(_SATISFIED)
        return None

    def terminate(self) -> None:
        """Pass the names of the tasks seen in this node to the expector."""
        for kind, names in self.parent.seen_tasks().items():
            # The names of terminate tasks are free reasons, so a similar one is not a typing error.
            if kind is not TaskType.terminate:
                self.factory.expector.add_other_tasks(kind, names)


def _shown(task_id: Expected) -> str:
    return describe(task_id) if isinstance(task_id, (tuple, TaskType)) else f"call '{task_id}'"


def _listed(ids: Sequence[Expected]) -> str:
    words = [_shown(task_id) for task_id in ids[:_SHOWN]]
    more = f" and {len(ids) - _SHOWN} more" if len(ids) > _SHOWN else ""
    return (", ".join(words) or "nothing") + more
