"""Handlers are looked up once, again when they change, and checked where they are set."""

from collections.abc import Callable
from typing import Any, ClassVar

import pytest

from snr_sim import (
    Config,
    Endpoint,
    EndpointFactory,
    Loop,
    Node,
    SimClock,
    SomeTasks,
    Task,
    TaskType,
    tasks,
)
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.task import TaskHandlerMap
from snr_sim.testing.function_components import FunctionEndpoint, FunctionEndpointFactory

X = (TaskType.event, "x")
Y = (TaskType.event, "y")


def new(task: Task, task_id: Any) -> SomeTasks:
    return tasks.terminate("new")


CHANGES: dict[str, Callable[[FunctionEndpoint], object]] = {
    "set": lambda part: part.task_handlers.__setitem__(X, new),
    "delete": lambda part: part.task_handlers.__delitem__(X),
    "update": lambda part: part.task_handlers.update({X: new}),
    "pop": lambda part: part.task_handlers.pop(X),
    "popitem": lambda part: part.task_handlers.popitem(),
    "clear": lambda part: part.task_handlers.clear(),
    "setdefault": lambda part: part.task_handlers.setdefault(TaskType.process_data, new),
    "or": lambda part: part.task_handlers.__ior__({X: new}),
    "reassign": lambda part: setattr(part, "task_handlers", {X: new}),
}
KEEPS_OLD = {"setdefault"}
REMOVES = {"delete", "pop", "popitem", "clear"}


@pytest.mark.parametrize("change", CHANGES)
def test_a_component_that_changes_its_handlers_while_running_is_seen(change: str) -> None:
    called: list[str] = []

    class Changing(FunctionEndpointFactory):
        def get(self, parent: Node) -> FunctionEndpoint:
            part = super().get(parent)

            def old(task: Task, task_id: Any) -> SomeTasks:
                called.append("old")
                return [Task(*X), Task(*Y)] if len(called) == 1 else None

            def change_now(task: Task, task_id: Any) -> SomeTasks:
                CHANGES[change](part)
                return [Task(*X), tasks.event("end")]

            part.task_handlers = {Y: change_now, X: old}
            return part

    end = FunctionEndpointFactory({(TaskType.event, "end"): lambda task, task_id: tasks.event("end2"),
                       (TaskType.event, "end2"): lambda task, task_id: tasks.terminate("end")}, "end")  # fmt: skip
    start = FunctionEndpointFactory(name="start", begin=lambda part: part.schedule(Task(*X)))
    node = Node("r", Config(factories={"r": [Changing(), end, start]}), clock=SimClock())
    node.loop()
    if change in KEEPS_OLD:
        assert called == ["old", "old", "old"]
    else:
        assert called == ["old", "old"]
        assert node.exit_reason == ("end" if change in REMOVES else "new")
    assert not [note for note in node.notes if "never sent" in note]  # tasks from before the change still count


class OfTheClass(Endpoint):
    """Its handlers are a table in the class: they are methods there, and each object has its own map."""

    def on_x(self, task: Task, task_id: Any) -> SomeTasks:
        self.count += 1
        if self.count == 1:
            return [Task(*Y), Task(*X)]  # y has no handler yet, and the lookup caches that
        self.task_handlers[Y] = new
        return Task(*Y)

    task_handlers: ClassVar[TaskHandlerMap] = {X: on_x}  # type: ignore[assignment, misc]
    count = 0

    def begin(self) -> None:
        self.schedule(Task(*X))


def test_handlers_of_the_class_are_methods_and_belong_to_each_object() -> None:
    nodes = [Node("r", Config(factories={"r": [OfTheClass.factory("part")]}), clock=SimClock()) for _ in range(2)]
    first, second = (node.components["part"] for node in nodes)
    first.task_handlers[Y] = new
    assert Y not in second.task_handlers
    nodes[1].loop()
    assert nodes[1].exit_reason == "new"
    assert isinstance(second, OfTheClass)
    assert second.count == 2


def test_weakness_29_handler_lookup_is_cached() -> None:
    looked: list[None] = []

    class Watched(FunctionEndpoint):
        @property
        def task_handlers(self) -> TaskHandlerMap:
            looked.append(None)
            return {}

        @task_handlers.setter
        def task_handlers(self, handlers: TaskHandlerMap) -> None:
            pass

    class WatchedFactory(FunctionEndpointFactory):
        def get(self, parent: Node) -> FunctionEndpoint:
            return Watched(self, parent, self.name)

    turns: list[None] = []

    def again(task: Task, task_id: Any) -> SomeTasks:
        turns.append(None)
        return tasks.terminate("done") if len(turns) == 1000 else task

    busy = FunctionEndpointFactory({X: again}, "busy", begin=lambda part: part.schedule(Task(*X)))
    others = [WatchedFactory(name=f"other{i}") for i in range(10)]
    Node("r", Config(factories={"r": [*others, busy]}), clock=SimClock()).loop()
    assert len(turns) == 1000
    assert len(looked) < 100


class Wrong(Endpoint):
    handlers: Any = None

    def __init__(self, factory: Any, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = factory.handlers_of(self)

    def takes_nothing(self) -> None: ...
    def takes_one(self, task: Task) -> None: ...
    def takes_three(self, task: Task, task_id: Any, more: int) -> None: ...
    def takes_any(self, *args: Any) -> None: ...
    def yields(self, task: Task, task_id: Any) -> Any:
        yield task

    async def waits(self, task: Task, task_id: Any) -> None: ...
    def takes_two_and_a_default(self, task: Task, task_id: Any, more: int = 0) -> None: ...


class WrongFactory(EndpointFactory):
    def __init__(self, handlers_of: Callable[[Wrong], Any]) -> None:
        super().__init__()
        self.handlers_of = handlers_of

    def get(self, parent: Node) -> Endpoint:
        return Wrong(self, parent, "mixer")


def build(handlers_of: Callable[[Wrong], Any]) -> Node:
    return Node("r", Config(factories={"r": [WrongFactory(handlers_of)]}), clock=SimClock())


@pytest.mark.parametrize(
    ("handlers_of", "message"),
    [
        (lambda wrong: {X: wrong.takes_nothing}, r"'mixer.takes_nothing' for event 'x' takes \(\).*but is called"),
        (lambda wrong: {X: wrong.takes_one}, r"def takes_one\(self, task, task_id\)"),
        (lambda wrong: {X: wrong.takes_three}, r"takes \(task.*more"),
        (
            lambda wrong: {X: wrong.yields},
            r"'mixer.yields' for event 'x' is a generator function: it has a yield.*\n.*list",
        ),
        (lambda wrong: {X: wrong.waits}, r"'mixer.waits' for event 'x' is an async function(.|\n)*def without async"),
        (lambda wrong: {X: wrong.takes_nothing()}, r"registers None for event 'x'.*\n.*self.on_start, not self.on_st"),
        (lambda wrong: {("x", TaskType.event): wrong.takes_any}, r"swapped.\n  Try: \(TaskType.event, 'x'\)"),
        (lambda wrong: {"x": wrong.takes_any}, r"'mixer' registers a handler for 'x', which no task can have"),
        (lambda wrong: {(TaskType.event, 5): wrong.takes_any}, r"which no task can have as its id"),
        (lambda wrong: [(X, wrong.takes_any)], r"'mixer' has task_handlers of type list"),
        (lambda wrong: None, r"has task_handlers of type NoneType"),
    ],
)
def test_a_wrong_handler_is_refused_where_it_is_registered(handlers_of: Callable[[Wrong], Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        build(handlers_of)


@pytest.mark.parametrize("handlers_of", [lambda w: {X: w.takes_any}, lambda w: {X: w.takes_two_and_a_default}])
def test_a_handler_that_can_take_task_and_id_is_accepted(handlers_of: Callable[[Wrong], Any]) -> None:
    assert build(handlers_of).components["mixer"].task_handlers


def test_a_wrong_handler_is_also_refused_when_it_is_added_later() -> None:
    node = build(lambda wrong: {X: wrong.takes_any})
    with pytest.raises(ConfigError, match="swapped"):
        node.components["mixer"].task_handlers["x", TaskType.event] = lambda task, task_id: None  # type: ignore[index]


def test_endpoint_without_handlers_is_accepted() -> None:
    node = Node("r", Config(factories={"r": [FunctionEndpointFactory()]}), clock=SimClock())
    node.loop()
    assert node.notes == []


class Yielding(Loop):
    def loop(self) -> Any:
        yield self.schedule(tasks.event("x"))


def test_a_loop_that_would_never_run_because_of_a_yield_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"^loop\(\) of component 'pump' is a generator function"):
        Node("r", Config(factories={"r": [Yielding.factory("pump")]}), clock=SimClock())


LATE_HANDLERS: list[list[Any]] = [
    [(TaskType.event, "fly")],
    [TaskType.event],
    [TaskType.event, (TaskType.event, "fly")],
    [(TaskType.event, "unheard")],
    [TaskType.reload, (TaskType.event, "add_component")],
    [(TaskType.store_page, "fly"), TaskType.process_data],
]


@pytest.mark.parametrize("task_ids", LATE_HANDLERS)
def test_added_component_appends_to_cached_handlers(task_ids: list[Any]) -> None:
    every = [Task(kind, name) for kind in TaskType for name in ("fly", "land", "add_component")]
    parts = [
        FunctionEndpointFactory({TaskType.event: noop, TaskType.reload: noop, TaskType.process_data: noop}, "early")
    ]
    node = Node("r", Config(factories={"r": parts}))
    lookup = node.machine.lookup
    for task in every:
        lookup.find(task)
    node.registry.replace_component(None, FunctionEndpointFactory(dict.fromkeys(task_ids, noop), "late").get(node))
    grown = [[entry[2:] for entry in lookup.find(task)] for task in every]
    node.handlers_changed()
    assert grown == [[entry[2:] for entry in lookup.find(task)] for task in every]


def test_added_component_keeps_cached_entries() -> None:
    parts = [FunctionEndpointFactory({(TaskType.event, "fly"): noop}, f"part{i}") for i in range(5)]
    node = Node("r", Config(factories={"r": parts}))
    lookup, task = node.machine.lookup, tasks.event("fly")
    before = lookup.find(task)
    node.registry.replace_component(None, FunctionEndpointFactory({(TaskType.event, "fly"): noop}, "late").get(node))
    assert all(one is other for one, other in zip(before, lookup.find(task), strict=False))


def noop(task: Task, task_id: Any) -> None:
    """Do nothing."""


@pytest.mark.parametrize(("others", "is_noted"), [(0, False), (1, True)])
@pytest.mark.parametrize("data", [{"altitude_m": 5.0, "path": [1]}, [5.0]])
def test_handler_that_changes_its_page_is_noted_if_others_handle_it(data: Any, others: int, is_noted: bool) -> None:
    def change(task: Task, task_id: Any) -> None:
        assert task.page is not None
        if isinstance(data, dict):
            task.page.data["path"].append(2)
        else:
            task.page.data[0] = 0.0

    def read(task: Task, task_id: Any) -> SomeTasks:
        return tasks.terminate("read")

    radar = (TaskType.process_data, "radar")
    start = FunctionEndpointFactory({}, "start", begin=lambda part: part.store_data("radar", data))
    readers = [FunctionEndpointFactory({radar: read}, "reader")] * others
    node = Node(
        "r",
        Config(factories={"r": [start, FunctionEndpointFactory({radar: change}, "writer"), *readers]}),
        clock=SimClock(),
    )
    node.loop()
    notes = [note for note in node.notes if "changes the page 'radar' that it reads" in note]
    assert len(notes) == is_noted
    for note in notes:
        assert note.splitlines()[0].endswith(": def change(task: Task, task_id: Any) -> None:")
        assert "change() of 'writer'" in note
        assert "radar = dict(radar)" in note
