"""Handler maps of components, and the node's cached lookup of the handlers of a task."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from types import AsyncGeneratorType, CodeType, CoroutineType, FunctionType, GeneratorType, MethodType
from typing import Any, TypeAlias
from weakref import WeakSet

from snr_sim.core.profiler import Profiler
from snr_sim.core.source_location import location_of
from snr_sim.prelude import tasks
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import ConfigError, TaskError, suggest
from snr_sim.prelude.task import SomeTasks, Task, TaskHandler, TaskId, TaskName, TaskType, snapshot

# One handler to call: its component, the function, the id it was registered for, and the names of both for the trace.
Entry: TypeAlias = tuple[Component, TaskHandler, TaskId, tuple[str, str]]

COPY_FIX = "change a copy: {0} = dict({0}), or list({0})."

# Functions that passed the check: each is checked once, however many components use it.
_checked: WeakSet[FunctionType] = WeakSet()

_NOT_RUN_AT_ONCE = inspect.CO_GENERATOR | inspect.CO_ASYNC_GENERATOR | inspect.CO_COROUTINE
_MUTATORS = ("__setitem__", "__delitem__", "__ior__", "clear", "pop", "popitem", "setdefault", "update")


class HandlerMap(dict[TaskId, TaskHandler]):
    """Handlers of a component, with a notification on change, so that the node can cache its lookup."""

    def __init__(self, handlers: Mapping[TaskId, TaskHandler], on_change: Callable[[], None]) -> None:
        super().__init__(handlers)
        self.on_change: Callable[[], None] = on_change


def _notifying(name: str) -> Callable[..., Any]:
    mutate = getattr(dict, name)

    def method(self: HandlerMap, *args: Any, **kwargs: Any) -> Any:
        result = mutate(self, *args, **kwargs)
        self.on_change()
        return result

    method.__name__ = name
    return method


for _name in _MUTATORS:
    setattr(HandlerMap, _name, _notifying(_name))


class HandlerLookup:
    """Cached lookup of a task's handlers, in time that does not grow with the number of components.

    Args:
        components: the node's components by name; the order is the order of their handlers.
        profiler: times each handler, if given. Handlers are wrapped here, so the machine does not depend on it.
    """

    def __init__(self, components: Mapping[str, Component], profiler: Profiler | None = None) -> None:
        self.components: Mapping[str, Component] = components
        self._profiler = profiler
        # Wraps a handler while new code is on probation (core/reload/rollback.py).
        self.wrap_handler: Callable[[Component, TaskHandler], TaskHandler] | None = None
        self.add_note: Callable[[str, str], None] = lambda text, lines: None  # about a handler that was called
        self.cache: dict[TaskType, dict[TaskName, tuple[Entry, ...]]] = {kind: {} for kind in TaskType}
        self._seen: dict[TaskType, dict[TaskName, tuple[Entry, ...]]] = {kind: {} for kind in TaskType}

    def invalidate(self) -> None:
        """Clear the cache: a component was added, was removed or changed its handlers."""
        self.seen_tasks()  # keeps what the cache knows of the run so far
        for by_name in self.cache.values():
            by_name.clear()

    def add(self, component: Component) -> None:
        """Append the handlers of an added component to the cached entries."""
        handlers = component.task_handlers
        for task_id in handlers:
            kind, name = task_id if isinstance(task_id, tuple) else (task_id, None)
            by_name = self.cache[kind]
            for one in list(by_name) if name is None else (name,):
                if one not in by_name or (name is None and (kind, one) in handlers):
                    continue
                if _is_change(kind, one) or (kind is TaskType.process_data and by_name[one]):  # `find` looks at all
                    self._seen[kind][one] = by_name.pop(one)
                else:
                    by_name[one] += (self._entry(component, task_id),)

    def seen_tasks(self) -> dict[TaskType, dict[TaskName, tuple[Entry, ...]]]:
        """Return every task id of this run so far, with its handlers; an empty tuple if it was never handled."""
        for kind, by_name in self.cache.items():
            seen = self._seen[kind]
            for name, entries in by_name.items():
                seen[name] = entries or seen.get(name, ())
        return self._seen

    def find(self, task: Task) -> tuple[Entry, ...]:
        """Return the handlers of a task: per component that of (type, name), else that of the type.

        Raises:
            TaskError: its type is not a TaskType, or its name is not a str.
        """
        check_task(task)
        by_name = self.cache[task.type]
        entries = by_name.get(task.name)
        if entries is None:
            entries = tuple(self._search(task.type, task.name))
            if _is_change(task.type, task.name):
                entries = entries[1:] + entries[:1]  # node_core last: a removed component's handler is not called
            if task.type is TaskType.process_data and len(entries) > 1:
                entries = tuple(
                    (one, watch_page(label, call, self.add_note), key, label) for one, call, key, label in entries
                )
            by_name[task.name] = entries
        return entries

    def _search(self, kind: TaskType, name: TaskName) -> Iterable[Entry]:
        for component in self.components.values():
            handlers = component.task_handlers
            for task_id in ((kind, name), kind):
                if task_id in handlers:
                    yield self._entry(component, task_id)
                    break

    def _entry(self, component: Component, task_id: TaskId) -> Entry:
        handler = component.task_handlers[task_id]
        label = (component.name, handler_name(handler))
        if self.wrap_handler is not None:
            handler = self.wrap_handler(component, handler)
        if self._profiler is not None:
            handler = self._profiler.timed(".".join(label), handler)
        return component, handler, task_id, label


def check_task(task: Task) -> None:
    """Raise a TaskError unless a node can execute a task: its type, its name, and that its values are a list."""
    if not isinstance(task.type, TaskType):
        raise TaskError(f"A task has the type {task.type!r}.", fix=suggest(str(task.type), TaskType.__members__))
    if not isinstance(task.name, str):
        raise TaskError(f"A task has the name {task.name!r}, which is not text.", fix="values go into val_list.")
    if not isinstance(task.val_list, (list, tuple)):
        raise TaskError(f"The task {describe(task.id())} carries {task.val_list!r}, which is not a list.", fix="[].")


def _is_change(kind: TaskType, name: TaskName) -> bool:
    """Whether a task changes the node's components."""
    return kind is TaskType.reload or (kind is TaskType.event and name in tasks.CHANGE_TASK_NAMES)


def check_handlers(owner: str, handlers: Any) -> None:
    """Check a component's handlers where they are set, not an hour into the dive.

    Raises:
        ConfigError: a key is not a task id, or a handler cannot be called with (task, task_id).
    """
    if not isinstance(handlers, Mapping):
        raise ConfigError(
            f"Component '{owner}' has task_handlers of type {type(handlers).__name__}.",
            fix="task_handlers is a dict: {(TaskType.event, 'start'): self.on_start}.",
        )
    for task_id, handler in handlers.items():
        check_id(owner, task_id)
        _check_handler(owner, task_id, handler)


def check_id(owner: str, task_id: Any) -> None:
    """Raise a ConfigError unless tasks can have this id."""
    if isinstance(task_id, TaskType):
        return
    if isinstance(task_id, tuple) and len(task_id) == 2:
        kind, name = task_id
        if isinstance(kind, TaskType) and isinstance(name, str):
            return
        if isinstance(name, TaskType) and isinstance(kind, str):
            raise ConfigError(
                f"Component '{owner}' registers a handler for ('{kind}', TaskType.{name.value}): the two are swapped.",
                fix=f"(TaskType.{name.value}, '{kind}').",
            )
    raise ConfigError(
        f"Component '{owner}' registers a handler for {task_id!r}, which no task can have as its id.",
        fix="a key is TaskType.event, or (TaskType.event, 'name').",
    )


def _check_handler(owner: str, task_id: TaskId, handler: Any) -> None:
    function = getattr(handler, "__func__", None)  # a bound method: the arguments left are task and id
    if isinstance(function, FunctionType) and function in _checked:
        return
    shown = handler_name(handler)
    if not callable(handler):
        raise ConfigError(
            f"Component '{owner}' registers {handler!r} for {describe(task_id)}, which is not a function.",
            fix="write the method's name without calling it: self.on_start, not self.on_start().",
        )
    check_returns(f"Handler '{owner}.{shown}' for {describe(task_id)}", handler)
    try:
        signature = inspect.signature(handler)
    except (TypeError, ValueError):
        return  # some callables written in C have no signature
    try:
        signature.bind(None, None)
    except TypeError:
        raise ConfigError(
            f"Handler '{owner}.{shown}' for {describe(task_id)} takes {signature}, but is called with (task, task_id).",
            fix=f"def {shown}(self, task, task_id).",
        ) from None
    if isinstance(function, FunctionType):
        _checked.add(function)


def check_returns(what: str, function: Any) -> None:
    """Check that calling a function runs it: a generator or coroutine would only be created and never run.

    Raises:
        ConfigError: it has a `yield`, or is `async`.
    """
    code = getattr(function, "__code__", None)
    if isinstance(code, CodeType) and not code.co_flags & _NOT_RUN_AT_ONCE:
        return
    if inspect.isgeneratorfunction(function) or inspect.isasyncgenfunction(function):
        raise ConfigError(
            f"{what} is a generator function: it has a yield.", fix="return a list of tasks instead of the yields."
        )
    if inspect.iscoroutinefunction(function):
        raise ConfigError(
            f"{what} is an async function, but handlers are not awaited.",
            fix="write def without async; a Loop does the work that has to wait.",
        )


def as_tasks(returned: SomeTasks | Any, component: Component, handler: Any) -> Sequence[Task]:
    """Return what a handler returned as a sequence of tasks; raise a TaskError if it is something else."""
    if type(returned) is Task:
        return (returned,)
    if returned is None:
        return ()
    if isinstance(returned, (list, tuple)):
        for item in returned:
            if type(item) is not Task:
                raise _not_a_task(item, component, handler, f"a {type(returned).__name__} with ", returned)
        return tuple(returned)
    raise _not_a_task(returned, component, handler, "")


def schedule_returned(returned: SomeTasks | Any, component: Any, step: Any) -> None:
    """Schedule what a component's `begin`, `setup` or `loop` has returned; raise a TaskError if it is not tasks."""
    if returned is not None:
        component.schedule(as_tasks(returned, component, step))


def _not_a_task(value: Any, component: Component, handler: Any, within: str, whole: Sequence[Any] = ()) -> TaskError:
    name = handler_name(handler)
    returned = f"'{component.name}.{name}' {'was given' if name == 'schedule' else 'returned'}"
    fix = "return None, a Task or a list of Tasks."
    if isinstance(value, CoroutineType):
        value.close()  # else Python warns that it was never awaited
    if isinstance(value, (GeneratorType, CoroutineType, AsyncGeneratorType)):  # disguised, as in a lambda
        kind = "a generator: it has a yield" if isinstance(value, GeneratorType) else "of an async function"
        return TaskError(f"{returned} what is {kind}, and not a task.", fix=fix)
    if isinstance(value, TaskType):
        fix = f"that is a kind of task; tasks.event('name') or Task(TaskType.{value.value}, 'name') makes one."
    elif len(whole) == 2 and isinstance(whole[0], str) and type(whole[1]) is not Task:
        fix = f"did you mean self.store_data_task({whole[0]!r}, ...)?"
    elif isinstance(value, (FunctionType, MethodType)):
        fix = f"call it, with round brackets: {handler_name(value)}(...)."
    elif isinstance(value, str):
        fix = f"did you mean tasks.event({value!r})?"
    return TaskError(f"{returned} {within}{value!r}, which is not a task.", fix=fix)


def handler_name(handler: Any) -> str:
    """Return a handler's name as in its author's code."""
    return getattr(handler, "__name__", None) or type(handler).__name__


def describe(task_id: TaskId) -> str:
    """Return a task id as text.

    >>> describe((TaskType.event, "start"))
    "event 'start'"
    """
    return f"{task_id[0].value} '{task_id[1]}'" if isinstance(task_id, tuple) else f"every {task_id.value}"


def watch_page(label: tuple[str, str], handler: TaskHandler, add_note: Callable[[str, str], None]) -> TaskHandler:
    """Return a wrapper of a handler of `process_data` that notes when it has changed the page's data.

    Other components that handle the page get the changed data. `scenario/controller_source.py` finds assignments to any
    page in the source.

    Args:
        label: names of component and handler.
        handler: the handler.
        add_note: adds a note, with the student's lines that it is about.
    """

    @wraps(handler)
    def call(task: Task, task_id: TaskId) -> SomeTasks:
        page = task.page
        if page is None or type(page.data) not in (dict, list):
            return handler(task, task_id)
        before = snapshot(page.data, [])
        returned = handler(task, task_id)
        if _is_changed(before, page.data):
            location = location_of(handler)
            add_note(
                f"{label[1]}() of '{label[0]}' changes the page '{page.key}' that it reads: other components get what "
                f"it has made of it.\n  Try: {COPY_FIX.format(page.key)}",
                "" if location is None else f"{location}\n  ",
            )
        return returned

    return call


def _is_changed(before: Any, data: Any) -> bool:
    try:
        return bool(before != data)
    except Exception:  # of arrays, and of objects with an __eq__ of their own: not known
        return False
