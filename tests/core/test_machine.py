"""Order of execution: which task is next, which components handle it, and what happens to queued tasks at the end."""

import gc
import threading
from collections.abc import Callable, Iterable
from typing import Any

import pytest

from snr_sim import Config, Mode, Node, Page, SimClock, SomeTasks, Task, TaskType, WallClock, tasks
from snr_sim.core.endpoint import Endpoint
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.testing.fake_recorder import FakeRecorder
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

MACHINES = {
    "bare": lambda factories: Node("r", Config(factories={"r": factories}), clock=SimClock()),
    "on the wall clock": lambda factories: Node("r", Config(factories={"r": factories}), clock=WallClock()),
    "recorded": lambda factories: Node(
        "r", Config(factories={"r": factories}), clock=SimClock(), recorder=FakeRecorder()
    ),
    "profiled": lambda factories: Node("r", Config(Mode.DEBUG, {"r": factories}), clock=SimClock()),
}
Make = Callable[[list[Any]], Node]


@pytest.fixture(params=MACHINES)
def make(request: pytest.FixtureRequest) -> Make:
    return MACHINES[request.param]


def listener(received: list[str], name: str = "listener") -> FunctionEndpointFactory:
    def on_event(task: Task, task_id: Any) -> None:
        received.append(task.name)

    return FunctionEndpointFactory({TaskType.event: on_event}, name)


def starts_with(*first: Task) -> FunctionEndpointFactory:
    return FunctionEndpointFactory(name="starter", begin=lambda part: part.schedule(list(first)))


def events(names: Iterable[str]) -> list[Task]:
    return [tasks.event(name) for name in names]


def run(node: Node) -> Node:
    node.loop()
    return node


def test_weakness_3_events_are_handled_in_the_order_they_were_scheduled(make: Make) -> None:
    received: list[str] = []
    on_last = FunctionEndpointFactory({(TaskType.event, "e5"): lambda task, task_id: tasks.terminate("done")})
    run(make([listener(received), starts_with(*events(["e1", "e2", "e3", "e4", "e5"])), on_last]))
    assert received == ["e1", "e2", "e3", "e4", "e5"]


def test_weakness_2_self_scheduling_event_does_not_starve_others(make: Make) -> None:
    turns = []

    def again(task: Task, task_id: Any) -> Task:
        turns.append(task)
        return task

    quitter = FunctionEndpointFactory(
        {(TaskType.event, "quit"): lambda task, task_id: tasks.terminate("done")}, "quitter"
    )
    run(
        make(
            [
                FunctionEndpointFactory({(TaskType.event, "again"): again}),
                quitter,
                starts_with(*events(["again", "quit"])),
            ]
        )
    )
    assert len(turns) < 20


def test_terminate_passes_everything_that_is_queued(make: Make) -> None:
    received: list[str] = []
    stop = FunctionEndpointFactory({(TaskType.event, "stop"): lambda task, task_id: tasks.terminate("stop")}, "stopper")
    count_at_end: list[int] = []
    at_end = FunctionEndpointFactory(
        {TaskType.terminate: lambda task, task_id: count_at_end.append(len(received))}, "at_end"
    )
    run(make([listener(received), stop, at_end, starts_with(*events(["stop", *"abcdef"]))]))
    assert count_at_end == [1]


@pytest.mark.slow
def test_terminate_from_other_thread_ends_busy_node() -> None:
    node = MACHINES["on the wall clock"](
        [FunctionEndpointFactory({TaskType.event: lambda task, task_id: task}), starts_with(tasks.event("again"))]
    )
    threading.Timer(0.02, lambda: node.schedule(tasks.terminate("enough"))).start()
    node.loop()
    assert node.exit_reason == "enough"
    assert node.machine.executed > 100


def test_all_handlers_of_a_task_run_before_anything_they_returned(make: Make) -> None:
    received: list[str] = []

    def handler_of(name: str) -> Callable[[Task, Any], SomeTasks]:
        def handler(task: Task, task_id: Any) -> list[Task]:
            received.append(f"{name} runs")
            return events([f"{name}1", f"{name}2"])

        return handler

    parts = [FunctionEndpointFactory({(TaskType.event, "go"): handler_of(name)}, name) for name in ("a", "b")]
    done = FunctionEndpointFactory({(TaskType.event, "b2"): lambda task, task_id: tasks.terminate("done")}, "done")
    run(make([*parts, listener(received), done, starts_with(tasks.event("go"))]))
    assert received == ["a runs", "b runs", "go", "a1", "a2", "b1", "b2"]


def test_scheduled_tasks_precede_returned_tasks(make: Make) -> None:
    received: list[str] = []

    class Both(FunctionEndpointFactory):
        def get(self, parent: Node) -> Any:
            part = super().get(parent)

            def go(task: Task, task_id: Any) -> SomeTasks:
                part.schedule(tasks.event("scheduled"))
                return [tasks.event("returned"), tasks.terminate("done")]

            part.task_handlers = {(TaskType.event, "go"): go}
            return part

    run(make([Both(), listener(received), starts_with(tasks.event("go"))]))
    assert received == ["go", "scheduled", "returned"]


def test_of_one_component_the_handler_of_the_exact_name_runs_and_no_other(make: Make) -> None:
    called: list[str] = []

    def exact(task: Task, task_id: Any) -> None:
        called.append(f"exact {task_id}")

    def general(task: Task, task_id: Any) -> SomeTasks:
        called.append(f"general {task_id}")
        return tasks.terminate("done")

    part = FunctionEndpointFactory({TaskType.event: general, (TaskType.event, "x"): exact})
    run(make([part, starts_with(*events(["x", "y"]))]))
    assert called == ["exact (<TaskType.event: 'event'>, 'x')", "general event"]


def test_components_handle_a_task_in_the_order_of_the_config(make: Make) -> None:
    called: list[str] = []
    parts = [
        FunctionEndpointFactory({TaskType.event: lambda task, task_id, name=name: called.append(name)}, name)
        for name in "cab"
    ]
    end = FunctionEndpointFactory({TaskType.event: lambda task, task_id: tasks.terminate("done")}, "end")
    run(make([*parts, end, starts_with(tasks.event("x"))]))
    assert called == ["c", "a", "b"]


class Reader(Endpoint):
    """Sees what it can read while store_page and process_data are handled."""

    def __init__(self, factory: Any, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.seen: list[tuple[str, Any, Any]] = []
        self.task_handlers = {(TaskType.store_page, "x"): self.look, (TaskType.process_data, "x"): self.look}

    def begin(self) -> None:
        self.store_data("x", 1)
        self.store_data("x", 2, process=False)
        self.schedule(tasks.event("end"))

    def look(self, task: Task, task_id: Any) -> None:
        self.seen.append((task.type.value, self.get_data("x"), self.get_data("x_prev")))


class ReaderFactory(FunctionEndpointFactory):
    def get(self, parent: Node) -> Any:
        return Reader(self, parent, "reader")


def test_store_page_handlers_get_new_page_before_process_data(make: Make) -> None:
    # Page 2 is stored before page 1 is processed.
    end = FunctionEndpointFactory(
        {(TaskType.event, "end"): lambda task, task_id: tasks.event("end2"),
         (TaskType.event, "end2"): lambda task, task_id: tasks.terminate("done")}
    )  # fmt: skip
    node = run(make([ReaderFactory(), end]))
    reader = node.components["reader"]
    assert isinstance(reader, Reader)
    assert reader.seen == [("store_page", 1, None), ("store_page", 2, 1), ("process_data", 1, None)]


class Sampler(Endpoint):
    """Stores five pages before the first is processed, and keeps what each handler reads."""

    def __init__(self, factory: Any, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.seen: list[Any] = []
        self.elsewhere: list[Any] = []
        self.task_handlers = {(TaskType.process_data, "x"): self.on_x, (TaskType.event, "last"): self.on_last}

    def begin(self) -> None:
        for i in range(5):
            self.store_data("x", i)
        self.store_data("y", "other")

    def on_x(self, task: Task, task_id: Any) -> SomeTasks:
        assert task.page is not None
        assert task.page is self.get_page("x") is self.parent.get_page("x")
        self.seen.append((task.page.data, self.get_data("x"), self.get_data("x_prev"), self.get_data("y")))
        return tasks.event("last") if task.page.data == 4 else None

    def on_last(self, task: Task, task_id: Any) -> SomeTasks:
        self.elsewhere.append(self.get_data("x"))
        return tasks.terminate("done")


def stores(key: str, values: Iterable[Any], process: bool = True) -> list[Task]:
    return [Task.store_page(Page(key, value, "r_node", 0.0, process)) for value in values]


class SamplerFactory(FunctionEndpointFactory):
    def get(self, parent: Node) -> Any:
        return Sampler(self, parent, "sampler")


def test_each_stored_page_is_processed_once_however_many_came_before_the_first(make: Make) -> None:
    sampler = run(make([SamplerFactory()])).components["sampler"]
    assert isinstance(sampler, Sampler)
    assert sampler.seen == [(i, i, i - 1 if i else None, "other") for i in range(5)]


def test_get_data_in_a_handler_of_anything_else_gives_the_newest_page(make: Make) -> None:
    node = run(make([SamplerFactory()]))
    sampler = node.components["sampler"]
    assert isinstance(sampler, Sampler)
    assert sampler.elsewhere == [4]
    assert node.get_data("x") == 4


@pytest.mark.slow
def test_get_data_on_other_thread_returns_newest_page() -> None:
    seen: list[Any] = []

    def on_x(task: Task, task_id: Any) -> None:
        reader = threading.Thread(target=lambda: seen.append(part.get_data("x")))
        reader.start()
        reader.join()

    node = MACHINES["bare"](
        [FunctionEndpointFactory({(TaskType.process_data, "x"): on_x}), starts_with(*stores("x", range(3)))]
    )
    part: Any = node.components["part"]
    run(node)
    assert seen == [2, 2, 2]


def test_a_process_data_task_without_a_page_is_of_the_newest_one(make: Make) -> None:
    seen: list[Any] = []

    def on_x(task: Task, task_id: Any) -> None:
        seen.append((task.page and task.page.data, part.get_data("x"), part.get_data("x_prev")))

    factory = FunctionEndpointFactory({(TaskType.process_data, "x"): on_x})
    node = make(
        [factory, starts_with(*stores("x", (1, 2), process=False), tasks.process_data("x"), tasks.finish("done"))]
    )
    part: Any = node.components["part"]
    run(node)
    assert seen == [(None, 2, 1)]


def test_the_age_in_a_handler_is_that_of_the_page_that_is_processed() -> None:
    ages: list[float] = []
    factory = FunctionEndpointFactory(
        {(TaskType.process_data, "x"): lambda task, task_id: ages.append(part.get_age_s("x"))}
    )
    old, new = (Task.store_page(Page("x", 0, "r_node", -age_s)) for age_s in (2.0, 1.0))
    node = MACHINES["bare"]([factory, starts_with(old, new)])
    part: Any = node.components["part"]
    run(node)
    assert ages == [2.0, 1.0]
    assert node.get_age_s("x") == 1.0


@pytest.mark.slow
def test_pages_that_were_processed_are_not_kept_while_the_queue_is_never_empty() -> None:
    count = 0

    def again(task: Task, task_id: Any) -> SomeTasks:
        nonlocal count
        count += 1
        alive.append(sum(type(one) is Page for one in gc.get_objects()))
        return [tasks.event("again"), part.store_data_task("x", [count])] if count < 100 else tasks.terminate("done")

    alive: list[int] = []
    node = MACHINES["bare"](
        [FunctionEndpointFactory({(TaskType.event, "again"): again}), starts_with(tasks.event("again"))]
    )
    part: Any = node.components["part"]
    run(node)
    assert max(alive) - alive[0] < 10


def test_time_stands_still_while_one_task_is_handled() -> None:
    times: list[float] = []

    def spend(task: Task, task_id: Any) -> SomeTasks:
        times.extend(node.get_time_s() for _ in range(1000))
        return None if task.name == "one" else tasks.terminate("done")

    node = MACHINES["on the wall clock"](
        [FunctionEndpointFactory({TaskType.event: spend}), starts_with(*events(["one", "two"]))]
    )
    node.loop()
    assert len(set(times[:1000])) == 1
    assert len(set(times)) == 2


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 10])
def test_pages_stored_just_before_the_end_are_still_processed(make: Make, count: int) -> None:
    processed: list[int] = []

    class Last(FunctionEndpointFactory):
        def get(self, parent: Node) -> Any:
            part = super().get(parent)
            part.task_handlers = {
                (TaskType.process_data, "x"): lambda task, task_id: processed.append(part.get_data("x"))
            }
            return part

    def store_and_end(loop: Any) -> None:
        for i in range(count):
            loop.store_data("x", i)
        loop.schedule(tasks.terminate("done"))
        loop.stop()

    run(make([Last(), FunctionLoopFactory(store_and_end)]))
    assert len(processed) == count


def test_results_of_queued_tasks_are_executed_at_end(make: Make) -> None:
    received: list[str] = []

    def next_one(task: Task, task_id: Any) -> SomeTasks:
        return tasks.event(f"e{int(task.name[1:]) + 1}") if task.name != "e8" else None

    chain = FunctionEndpointFactory({TaskType.event: next_one}, "chain")
    node = run(make([chain, listener(received), starts_with(tasks.event("e1"), tasks.terminate("done"))]))
    assert received == [f"e{i}" for i in range(1, 9)]
    assert node.notes == []


def test_self_scheduling_task_is_cut_off_at_end_with_note(make: Make) -> None:
    again = FunctionEndpointFactory({TaskType.event: lambda task, task_id: task})
    node = run(make([again, starts_with(tasks.event("again"), tasks.terminate("done"))]))
    assert len(node.notes) == 1
    assert node.notes[0].startswith("The node ended with 1 tasks undone")


@pytest.mark.slow
def test_a_fast_loop_is_not_taken_for_tasks_that_keep_scheduling() -> None:
    node = MACHINES["on the wall clock"](
        [
            FunctionLoopFactory(lambda loop: loop.store_data("x", 1), rate_hz=0),
            FunctionLoopFactory(lambda loop: loop.get_data("x") and loop.schedule(tasks.terminate("done")), "ender"),
        ]
    )
    node.loop()
    assert not [note for note in node.notes if "scheduling" in note]


@pytest.mark.parametrize(
    ("returned", "hint"),
    [
        ("landed", "did you mean tasks.event('landed')?"),
        ({"a": 1}, "return None, a Task or a list of Tasks"),
        (7, "returned 7, which is not a task"),
        (True, "returned True, which is not a task"),
        ([None], "returned a list with None, which is not a task"),
        ([tasks.event("a"), "b"], "returned a list with 'b', which is not a task"),
        (TaskType.event, "tasks.event('name')"),
        ((TaskType.event, "a"), "which is not a task"),
    ],
)
def test_handler_returning_non_task_raises_with_value(make: Make, returned: Any, hint: str) -> None:
    part = FunctionEndpointFactory({(TaskType.event, "go"): lambda task, task_id: returned}, "navigator")
    with pytest.raises(ComponentFailedError) as caught:
        run(make([part, starts_with(tasks.event("go"))]))
    assert hint in str(caught.value)
    assert "'navigator'" in str(caught.value)
    assert "event 'go'" in str(caught.value)


async def waiting() -> None: ...


@pytest.mark.parametrize(
    ("returned", "found"),
    [
        (
            lambda: (one for one in [tasks.event("a")]),
            "'navigator.<lambda>' returned what is a generator: it has a yield",
        ),
        (waiting, "'navigator.<lambda>' returned what is of an async function"),
        (lambda: [object()], "a list with <object object>, which is not a task"),
    ],
)
def test_messages_contain_no_memory_addresses(make: Make, returned: Any, found: str) -> None:
    part = FunctionEndpointFactory({(TaskType.event, "go"): lambda task, task_id: returned()}, "navigator")
    with pytest.raises(ComponentFailedError) as caught:
        run(make([part, starts_with(tasks.event("go"))]))
    assert found in str(caught.value)
    assert "0x" not in str(caught.value)


@pytest.mark.parametrize("empty", [None, [], ()])
def test_a_handler_may_return_nothing(make: Make, empty: SomeTasks) -> None:
    idle = FunctionEndpointFactory({(TaskType.event, "go"): lambda task, task_id: empty}, "quiet")
    node = run(make([idle, starts_with(tasks.event("go"), tasks.terminate("done"))]))
    assert node.exit_reason == "done"


def test_the_reason_to_end_is_kept_and_the_first_one_counts(make: Make) -> None:
    node = run(make([starts_with(tasks.terminate("first"), tasks.terminate("second"))]))
    assert node.exit_reason == "first"


def test_store_page_task_without_page_raises_with_fix(make: Make) -> None:
    with pytest.raises(ComponentFailedError, match=r"store_data_task\(key, data\)"):
        run(make([starts_with(Task(TaskType.store_page, "x"))]))
    with pytest.raises(ComponentFailedError, match="carries 5, which is not a page"):
        run(make([starts_with(Task(TaskType.store_page, "x", [5]))]))


def test_a_task_of_a_kind_that_does_not_exist_is_named(make: Make) -> None:
    with pytest.raises(ComponentFailedError, match=r"(?s)'evnt'.*did you mean 'event'"):
        run(make([starts_with(Task("evnt", "x"))]))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [5, ["x"], None])
def test_task_with_non_text_name_raises_task_error(make: Make, name: Any) -> None:
    with pytest.raises(ComponentFailedError, match="which is not text"):
        run(make([starts_with(tasks.event("x"), Task(TaskType.event, name))]))


def test_pages_go_through_the_machine_by_reference_and_keep_their_stamp(make: Make) -> None:
    page = Page("x", [1.0], "elsewhere_node", 0.125)
    node = run(make([starts_with(tasks.store_page(page), tasks.terminate("done"))]))
    assert node.get_page("x") is page


def test_the_recorded_run_executes_the_same_tasks_in_the_same_order_as_the_bare_one() -> None:
    def program(received: list[str]) -> list[Any]:
        def fan_out(task: Task, task_id: Any) -> list[Task]:
            return events(f"{task.name}{i}" for i in range(3)) if len(task.name) < 4 else []

        receiver = listener(received)
        fan = FunctionEndpointFactory({TaskType.event: fan_out}, "fan")
        return [fan, receiver, FunctionLoopFactory(lambda loop: loop.schedule(events("xy")), rate_hz=5)]

    orders: list[list[str]] = []
    for kind in ("bare", "recorded", "profiled"):
        received: list[str] = []
        ender = FunctionLoopFactory(
            lambda loop: loop.get_time_s() >= 1.0 and loop.schedule(tasks.terminate("done")), "ender", 1
        )
        run(MACHINES[kind]([*program(received), ender]))
        orders.append(received)
    assert len(orders[0]) > 100
    assert orders[0] == orders[1] == orders[2]
