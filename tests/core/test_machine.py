"""Order of execution: which task is next, which components handle it, and what happens to queued tasks at the end."""

import gc
import threading
from collections.abc import Callable, Iterable
from typing import Any

import pytest

from snr_sim import Config, Mode, Node, Page, SimClock, SomeTasks, Task, TaskType, WallClock, tasks
from snr_sim.core.endpoint import Endpoint
from snr_sim.prelude.errors import ComponentFailed
from snr_sim.testing.parts import PartFactory, TickerFactory
from snr_sim.testing.witness import Witness

MACHINES = {
    "bare": lambda factories: Node("r", Config(factories={"r": factories}), clock=SimClock()),
    "on the wall clock": lambda factories: Node("r", Config(factories={"r": factories}), clock=WallClock()),
    "recorded": lambda factories: Node("r", Config(factories={"r": factories}), clock=SimClock(), recorder=Witness()),
    "profiled": lambda factories: Node("r", Config(Mode.DEBUG, {"r": factories}), clock=SimClock()),
}
Make = Callable[[list[Any]], Node]


@pytest.fixture(params=MACHINES)
def make(request: pytest.FixtureRequest) -> Make:
    return MACHINES[request.param]


def listener(heard: list[str], name: str = "listener") -> PartFactory:
    def hear(task: Task, task_id: Any) -> None:
        heard.append(task.name)

    return PartFactory({TaskType.event: hear}, name)


def starts_with(*first: Task) -> PartFactory:
    return PartFactory(name="starter", begin=lambda part: part.schedule(list(first)))


def events(names: Iterable[str]) -> list[Task]:
    return [tasks.event(name) for name in names]


def run(node: Node) -> Node:
    node.loop()
    return node


def test_weakness_3_events_are_handled_in_the_order_they_were_scheduled(make: Make) -> None:
    heard: list[str] = []
    on_last = PartFactory({(TaskType.event, "e5"): lambda task, task_id: tasks.terminate("done")})
    run(make([listener(heard), starts_with(*events(["e1", "e2", "e3", "e4", "e5"])), on_last]))
    assert heard == ["e1", "e2", "e3", "e4", "e5"]


def test_weakness_2_an_event_that_reschedules_itself_starves_nobody(make: Make) -> None:
    turns = []

    def again(task: Task, task_id: Any) -> Task:
        turns.append(task)
        return task

    quitter = PartFactory({(TaskType.event, "quit"): lambda task, task_id: tasks.terminate("done")}, "quitter")
    run(make([PartFactory({(TaskType.event, "again"): again}), quitter, starts_with(*events(["again", "quit"]))]))
    assert len(turns) < 20


def test_terminate_passes_everything_that_is_queued(make: Make) -> None:
    heard: list[str] = []
    stop = PartFactory({(TaskType.event, "stop"): lambda task, task_id: tasks.terminate("stop")}, "stopper")
    count_at_end: list[int] = []
    at_end = PartFactory({TaskType.terminate: lambda task, task_id: count_at_end.append(len(heard))}, "at_end")
    run(make([listener(heard), stop, at_end, starts_with(*events(["stop", *"abcdef"]))]))
    assert count_at_end == [1]


@pytest.mark.slow
def test_a_terminate_task_from_another_thread_ends_a_node_that_is_busy_for_ever() -> None:
    node = MACHINES["on the wall clock"](
        [PartFactory({TaskType.event: lambda task, task_id: task}), starts_with(tasks.event("again"))]
    )
    threading.Timer(0.02, lambda: node.schedule(tasks.terminate("enough"))).start()
    node.loop()
    assert node.exit_reason == "enough"
    assert node.machine.executed > 100


def test_all_handlers_of_a_task_run_before_anything_they_returned(make: Make) -> None:
    heard: list[str] = []

    def says(name: str) -> Callable[[Task, Any], SomeTasks]:
        def handler(task: Task, task_id: Any) -> list[Task]:
            heard.append(f"{name} runs")
            return events([f"{name}1", f"{name}2"])

        return handler

    parts = [PartFactory({(TaskType.event, "go"): says(name)}, name) for name in ("a", "b")]
    done = PartFactory({(TaskType.event, "b2"): lambda task, task_id: tasks.terminate("done")}, "done")
    run(make([*parts, listener(heard), done, starts_with(tasks.event("go"))]))
    assert heard == ["a runs", "b runs", "go", "a1", "a2", "b1", "b2"]


def test_what_a_handler_schedules_comes_before_what_it_returns(make: Make) -> None:
    heard: list[str] = []

    class Both(PartFactory):
        def get(self, parent: Node) -> Any:
            part = super().get(parent)

            def go(task: Task, task_id: Any) -> SomeTasks:
                part.schedule(tasks.event("scheduled"))
                return [tasks.event("returned"), tasks.terminate("done")]

            part.task_handlers = {(TaskType.event, "go"): go}
            return part

    run(make([Both(), listener(heard), starts_with(tasks.event("go"))]))
    assert heard == ["go", "scheduled", "returned"]


def test_of_one_component_the_handler_of_the_exact_name_runs_and_no_other(make: Make) -> None:
    called: list[str] = []

    def exact(task: Task, task_id: Any) -> None:
        called.append(f"exact {task_id}")

    def general(task: Task, task_id: Any) -> SomeTasks:
        called.append(f"general {task_id}")
        return tasks.terminate("done")

    part = PartFactory({TaskType.event: general, (TaskType.event, "x"): exact})
    run(make([part, starts_with(*events(["x", "y"]))]))
    assert called == ["exact (<TaskType.event: 'event'>, 'x')", "general event"]


def test_components_handle_a_task_in_the_order_of_the_config(make: Make) -> None:
    called: list[str] = []
    parts = [
        PartFactory({TaskType.event: lambda task, task_id, name=name: called.append(name)}, name) for name in "cab"
    ]
    end = PartFactory({TaskType.event: lambda task, task_id: tasks.terminate("done")}, "end")
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


class ReaderFactory(PartFactory):
    def get(self, parent: Node) -> Any:
        return Reader(self, parent, "reader")


def test_handlers_of_store_page_see_the_new_page_and_process_data_follows_if_asked_for(make: Make) -> None:
    # Page 2 is stored before page 1 is processed.
    end = PartFactory(
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


class SamplerFactory(PartFactory):
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
def test_get_data_on_another_thread_gives_the_newest_page_while_an_older_one_is_processed() -> None:
    seen: list[Any] = []

    def on_x(task: Task, task_id: Any) -> None:
        reader = threading.Thread(target=lambda: seen.append(part.get_data("x")))
        reader.start()
        reader.join()

    node = MACHINES["bare"]([PartFactory({(TaskType.process_data, "x"): on_x}), starts_with(*stores("x", range(3)))])
    part: Any = node.components["part"]
    run(node)
    assert seen == [2, 2, 2]


def test_a_process_data_task_without_a_page_is_of_the_newest_one(make: Make) -> None:
    seen: list[Any] = []

    def on_x(task: Task, task_id: Any) -> None:
        seen.append((task.page and task.page.data, part.get_data("x"), part.get_data("x_prev")))

    factory = PartFactory({(TaskType.process_data, "x"): on_x})
    node = make(
        [factory, starts_with(*stores("x", (1, 2), process=False), tasks.process_data("x"), tasks.finish("done"))]
    )
    part: Any = node.components["part"]
    run(node)
    assert seen == [(None, 2, 1)]


def test_the_age_in_a_handler_is_that_of_the_page_that_is_processed() -> None:
    ages: list[float] = []
    factory = PartFactory({(TaskType.process_data, "x"): lambda task, task_id: ages.append(part.get_age_s("x"))})
    old, new = (Task.store_page(Page("x", 0, "r_node", -age_s)) for age_s in (2.0, 1.0))
    node = MACHINES["bare"]([factory, starts_with(old, new)])
    part: Any = node.components["part"]
    run(node)
    assert ages == [2.0, 1.0]
    assert node.get_age_s("x") == 1.0


def test_pages_that_were_processed_are_not_kept_while_the_queue_is_never_empty() -> None:
    count = 0

    def again(task: Task, task_id: Any) -> SomeTasks:
        nonlocal count
        count += 1
        alive.append(sum(type(one) is Page for one in gc.get_objects()))
        return [tasks.event("again"), part.store_data_task("x", [count])] if count < 100 else tasks.terminate("done")

    alive: list[int] = []
    node = MACHINES["bare"]([PartFactory({(TaskType.event, "again"): again}), starts_with(tasks.event("again"))])
    part: Any = node.components["part"]
    run(node)
    assert max(alive) - alive[0] < 10


def test_time_stands_still_while_one_task_is_handled() -> None:
    times: list[float] = []

    def spend(task: Task, task_id: Any) -> SomeTasks:
        times.extend(node.get_time_s() for _ in range(1000))
        return None if task.name == "one" else tasks.terminate("done")

    node = MACHINES["on the wall clock"]([PartFactory({TaskType.event: spend}), starts_with(*events(["one", "two"]))])
    node.loop()
    assert len(set(times[:1000])) == 1
    assert len(set(times)) == 2


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 10])
def test_pages_stored_just_before_the_end_are_still_processed(make: Make, count: int) -> None:
    processed: list[int] = []

    class Last(PartFactory):
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

    run(make([Last(), TickerFactory(store_and_end)]))
    assert len(processed) == count


def test_what_follows_from_what_was_queued_at_the_end_is_finished_too(make: Make) -> None:
    heard: list[str] = []

    def next_one(task: Task, task_id: Any) -> SomeTasks:
        return tasks.event(f"e{int(task.name[1:]) + 1}") if task.name != "e8" else None

    chain = PartFactory({TaskType.event: next_one}, "chain")
    node = run(make([chain, listener(heard), starts_with(tasks.event("e1"), tasks.terminate("done"))]))
    assert heard == [f"e{i}" for i in range(1, 9)]
    assert node.notes == []


def test_at_the_end_a_task_that_asks_for_itself_is_cut_off_and_the_run_says_so(make: Make) -> None:
    again = PartFactory({TaskType.event: lambda task, task_id: task})
    node = run(make([again, starts_with(tasks.event("again"), tasks.terminate("done"))]))
    assert len(node.notes) == 1
    assert node.notes[0].startswith("The node ended with 1 tasks undone")


@pytest.mark.slow
def test_a_fast_loop_is_not_taken_for_tasks_that_keep_scheduling() -> None:
    node = MACHINES["on the wall clock"](
        [
            TickerFactory(lambda loop: loop.store_data("x", 1), rate_hz=0),
            TickerFactory(lambda loop: loop.get_data("x") and loop.schedule(tasks.terminate("done")), "ender"),
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
def test_a_handler_that_returns_something_else_is_told_what_it_returned(make: Make, returned: Any, hint: str) -> None:
    part = PartFactory({(TaskType.event, "go"): lambda task, task_id: returned}, "navigator")
    with pytest.raises(ComponentFailed) as caught:
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
def test_no_message_tells_where_an_object_is_in_memory(make: Make, returned: Any, found: str) -> None:
    part = PartFactory({(TaskType.event, "go"): lambda task, task_id: returned()}, "navigator")
    with pytest.raises(ComponentFailed) as caught:
        run(make([part, starts_with(tasks.event("go"))]))
    assert found in str(caught.value)
    assert "0x" not in str(caught.value)


@pytest.mark.parametrize("empty", [None, [], ()])
def test_a_handler_may_return_nothing(make: Make, empty: SomeTasks) -> None:
    quiet = PartFactory({(TaskType.event, "go"): lambda task, task_id: empty}, "quiet")
    node = run(make([quiet, starts_with(tasks.event("go"), tasks.terminate("done"))]))
    assert node.exit_reason == "done"


def test_the_reason_to_end_is_kept_and_the_first_one_counts(make: Make) -> None:
    node = run(make([starts_with(tasks.terminate("first"), tasks.terminate("second"))]))
    assert node.exit_reason == "first"


def test_a_store_page_task_without_a_page_says_how_to_make_one(make: Make) -> None:
    with pytest.raises(ComponentFailed, match=r"store_data_task\(key, data\)"):
        run(make([starts_with(Task(TaskType.store_page, "x"))]))
    with pytest.raises(ComponentFailed, match="carries 5, which is not a page"):
        run(make([starts_with(Task(TaskType.store_page, "x", [5]))]))


def test_a_task_of_a_kind_that_does_not_exist_is_named(make: Make) -> None:
    with pytest.raises(ComponentFailed, match=r"(?s)'evnt'.*did you mean 'event'"):
        run(make([starts_with(Task("evnt", "x"))]))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [5, ["x"], None])
def test_a_task_whose_name_is_no_text_is_named(make: Make, name: Any) -> None:
    with pytest.raises(ComponentFailed, match="which is not text"):
        run(make([starts_with(tasks.event("x"), Task(TaskType.event, name))]))


def test_pages_go_through_the_machine_by_reference_and_keep_their_stamp(make: Make) -> None:
    page = Page("x", [1.0], "elsewhere_node", 0.125)
    node = run(make([starts_with(tasks.store_page(page), tasks.terminate("done"))]))
    assert node.get_page("x") is page


def test_the_recorded_run_executes_the_same_tasks_in_the_same_order_as_the_bare_one() -> None:
    def program(heard: list[str]) -> list[Any]:
        def fan_out(task: Task, task_id: Any) -> list[Task]:
            return events(f"{task.name}{i}" for i in range(3)) if len(task.name) < 4 else []

        hear = listener(heard)
        fan = PartFactory({TaskType.event: fan_out}, "fan")
        return [fan, hear, TickerFactory(lambda loop: loop.schedule(events("xy")), rate_hz=5)]

    orders: list[list[str]] = []
    for kind in ("bare", "recorded", "profiled"):
        heard: list[str] = []
        ender = TickerFactory(
            lambda loop: loop.get_time_s() >= 1.0 and loop.schedule(tasks.terminate("done")), "ender", 1
        )
        run(MACHINES[kind]([*program(heard), ender]))
        orders.append(heard)
    assert len(orders[0]) > 100
    assert orders[0] == orders[1] == orders[2]
