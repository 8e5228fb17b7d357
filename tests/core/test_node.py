"""A node's life cycle: creation, begin, run, end; and its messages when a component fails."""

import inspect
import itertools
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim import (
    Config,
    Endpoint,
    EndpointFactory,
    Loop,
    LoopFactory,
    Node,
    SimClock,
    SomeTasks,
    Task,
    TaskType,
    handles,
    tasks,
)
from snr_sim.core.node_life import OVERLOAD_TASKS
from snr_sim.core.node_report import MAX_NOTES
from snr_sim.core.run_diagnostics import MAX_OF_A_KIND
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, TaskError, UnknownNameError
from snr_sim.prelude.rng import component_seed, rng_for
from snr_sim.testing.fake_recorder import FakeRecorder
from snr_sim.testing.function_components import FunctionEndpoint, FunctionEndpointFactory, FunctionLoopFactory


def node_of(*factories: Any, seed: int = 0, recorder: Any = None) -> Node:
    return Node("r", Config(factories={"r": list(factories)}), clock=SimClock(), seed=seed, recorder=recorder)


def ender(after_s: float = 0.0) -> FunctionLoopFactory:
    def end(loop: Any) -> None:
        if loop.get_time_s() >= after_s:
            loop.schedule(tasks.terminate("done"))

    return FunctionLoopFactory(end, "ender")


def logged(log: list[str], name: str) -> FunctionEndpointFactory:
    def logs(step: str) -> Callable[[FunctionEndpoint], None]:
        return lambda part: log.append(f"{name}.{step}")

    return FunctionEndpointFactory({}, name, begin=logs("begin"), halt=logs("halt"), terminate=logs("terminate"))


# Life


def test_components_begin_in_order_and_each_is_halted_and_terminated_once() -> None:
    log: list[str] = []
    node_of(logged(log, "a"), logged(log, "b"), ender()).loop()
    assert log == ["a.begin", "b.begin", "a.halt", "a.terminate", "b.halt", "b.terminate"]


def test_a_loop_is_set_up_looped_halted_and_terminated_in_that_order() -> None:
    log: list[str] = []
    steps = {step: (lambda loop, step=step: log.append(step)) for step in ("setup", "halt", "terminate")}
    node_of(FunctionLoopFactory(lambda loop: log.append("loop"), rate_hz=10, **steps), ender(0.2)).loop()
    assert log == ["setup", "loop", "loop", "loop", "halt", "terminate"]


class TaskReturning(Endpoint):
    def begin(self) -> SomeTasks:
        return self.store_data_task("begun", 1)

    @handles("ticked")
    def on_tick(self, data: Any) -> SomeTasks:
        return self.store_data_task("answer", data)


class ReturningLoop(Loop):
    max_tick_rate_hz = 1.0

    def setup(self) -> SomeTasks:
        return [self.store_data_task("set_up", 2)]

    def loop(self) -> SomeTasks:
        return self.store_data_task("ticked", 3)


class Wrong(Loop):
    def loop(self) -> SomeTasks:
        return {"throttle": 1.0}  # type: ignore[return-value]


def test_tasks_that_begin_setup_and_loop_return_are_executed_and_recorded() -> None:
    recorder = FakeRecorder()
    node = node_of(TaskReturning.factory(), ReturningLoop.factory(), ender(), recorder=recorder)
    node.loop()
    pages = {key: page.data for key, page in node.datastore.pages.items()}
    assert pages == {"begun": 1, "set_up": 2, "ticked": 3, "answer": 3}


def test_loop_that_returns_something_else_raises_with_its_line() -> None:
    with pytest.raises(ComponentFailedError, match=r"test_node.py, line \d+: def loop(.|\n)*which is not a task"):
        node_of(Wrong.factory()).loop()


def test_a_node_runs_once() -> None:
    node = node_of(ender())
    node.loop()
    with pytest.raises(ConfigError, match="'r_node' has already run"):
        node.loop()


def busy(at: int, then: Callable[[FunctionEndpoint], object]) -> FunctionEndpointFactory:
    """A part that asks for its next event in each one, and does something in one of them."""
    count = itertools.count()

    def spin(task: Task, task_id: Any) -> SomeTasks:
        if next(count) == at:
            then(part_of[0])
        return tasks.event("spin")

    part_of: list[FunctionEndpoint] = []

    def begin(part: FunctionEndpoint) -> None:
        part_of.append(part)
        part.schedule(tasks.event("spin"))

    return FunctionEndpointFactory({(TaskType.event, "spin"): spin}, "busy", begin=begin)


def test_terminate_flag_ends_node_with_nonempty_queue() -> None:
    node = node_of(busy(100, lambda part: part.parent.set_terminate_flag("enough")))
    node.loop()
    assert node.exit_reason == "enough"
    assert node.machine.executed < 150


def test_first_terminate_flag_sets_exit_reason() -> None:
    def end(part: FunctionEndpoint) -> None:
        part.parent.set_terminate_flag("first")
        part.parent.set_terminate_flag("second")

    node = node_of(busy(3, end))
    node.loop()
    assert node.exit_reason == "first"


def test_terminate_flag_before_begin_ends_node_immediately() -> None:
    node = node_of(busy(10_000, lambda part: part.parent.set_terminate_flag("too late")))
    node.set_terminate_flag("before")
    node.loop()
    assert node.exit_reason == "before"


def test_failed_halt_is_reported_as_halt_and_others_are_noted() -> None:
    def fail(what: str) -> Callable[[FunctionEndpoint], None]:
        def raises(part: FunctionEndpoint) -> None:
            raise ValueError(f"{part.name}: {what}")

        return raises

    parts = [FunctionEndpointFactory({}, name, halt=fail("stuck"), terminate=fail("lost")) for name in ("a", "b")]
    node = node_of(*parts, ender())
    with pytest.raises(ComponentFailedError, match=r"a: stuck(.|\n)*in halt\(\) of component 'a'") as caught:
        node.loop()
    assert caught.value.step == "halt"
    text = "\n".join(node.notes)
    for words in ("a: lost", "in terminate() of component 'a'", "b: stuck", "in halt() of component 'b'", "b: lost"):
        assert words in text


def test_second_failure_at_end_is_noted() -> None:
    def fail(part: FunctionEndpoint) -> None:
        raise ValueError("stuck valve")

    def crash(task: Task, task_id: Any) -> SomeTasks:
        raise KeyError("depth")

    handlers = {(TaskType.event, "go"): crash}
    part = FunctionEndpointFactory(handlers, "part", begin=lambda part: part.schedule(tasks.event("go")), halt=fail)
    node = node_of(part)
    with pytest.raises(ComponentFailedError, match="KeyError: 'depth'"):
        node.loop()
    assert "stuck valve" in "".join(node.notes)


def test_number_of_notes_is_limited() -> None:
    node = node_of()
    for i in range(3 * MAX_NOTES):
        node.add_note(f"number {i}")
    assert len(node.notes) == MAX_NOTES
    assert node.notes[-2:] == [f"number {MAX_NOTES - 2}", "There was more to note, which is left out."]


def test_notes_of_one_kind_are_limited_and_leave_room_for_others() -> None:
    def begin(part: FunctionEndpoint) -> None:
        for i in range(3 * MAX_OF_A_KIND):
            part.schedule(tasks.event(f"made up {i}"))
        part.get_page("depth")

    node = node_of(FunctionEndpointFactory({}, begin=begin))
    node.loop()
    unhandled = [note for note in node.notes if note.startswith("No component handled event 'made up ")]
    assert len(unhandled) == MAX_OF_A_KIND
    assert "There are more tasks without a handler, which are left out." in node.notes
    assert any("Page 'depth' was requested but never stored" in note for note in node.notes)


def test_page_named_like_previous_page_is_noted() -> None:
    def store(part: FunctionEndpoint) -> None:
        part.store_data("x", 1)
        part.store_data("x_prev", "mine")
        part.store_data("y_prev", 0)  # of which there is no newest one

    node = node_of(FunctionEndpointFactory({}, begin=store))
    node.loop()
    matching = [note for note in node.notes if "is also the name" in note]
    assert len(matching) == 1
    assert "Page 'x_prev' was stored, which is also the name of the page before the newest 'x'" in matching[0]


def test_idle_node_ends_in_virtual_time() -> None:
    node = node_of(FunctionEndpointFactory())
    node.loop()
    assert node.exit_reason == "nothing left to do"


# Made wrongly


def test_unknown_role_raises_with_existing_roles() -> None:
    with pytest.raises(UnknownNameError, match=r"no role 'tosbide'(.|\n)*did you mean 'topside'"):
        Node("tosbide", Config(factories={"topside": [], "robot": []}))


class Returning(EndpointFactory):
    def __init__(self, component: Any) -> None:
        super().__init__()
        self.component = component

    def get(self, parent: Node) -> Any:
        return self.component


@pytest.mark.parametrize("component", [None, 42])
def test_factory_without_endpoint_raises_with_its_name(component: Any) -> None:
    with pytest.raises(
        ConfigError, match=rf"Returning.get\(\) of role 'r' returned {component}(.|\n)*return MyEndpoint"
    ):
        node_of(Returning(component))


def test_factory_without_get_raises_not_implemented() -> None:
    class Unfinished(LoopFactory):
        pass

    with pytest.raises(ConfigError, match=r"Unfinished needs a method get\(self, parent\)"):
        node_of(Unfinished())


@pytest.mark.parametrize("wrong", [FunctionEndpointFactory, None, "part"])
def test_non_factory_raises_config_error(wrong: Any) -> None:
    with pytest.raises(ConfigError, match=r"where a factory belongs(.|\n)*list instances"):
        node_of(wrong)


def test_duplicate_component_name_raises_config_error() -> None:
    with pytest.raises(ConfigError, match="two components named 'depth': a FunctionEndpoint and a FunctionLoop"):
        node_of(FunctionEndpointFactory(name="depth"), FunctionLoopFactory(name="depth"))


def test_component_named_node_core_raises_config_error() -> None:
    with pytest.raises(ConfigError, match="two components named 'node_core'"):
        node_of(FunctionEndpointFactory(name="node_core"))


def test_methods_of_a_class_are_checked_once_and_not_for_each_component(monkeypatch: pytest.MonkeyPatch) -> None:
    checked, signature = [], inspect.signature
    monkeypatch.setattr(inspect, "signature", lambda function: checked.append(function) or signature(function))
    factories = [FunctionEndpointFactory({}, f"one_{i}") for i in range(100)]
    assert len(node_of(*factories).components) > 100
    assert len(checked) <= 20


class WithoutSuper(Endpoint):
    def __init__(self, parent: Node) -> None:
        self.counter = 0


class WithoutSuperFactory(EndpointFactory):
    def get(self, parent: Node) -> Any:
        return WithoutSuper(parent)


def test_endpoint_without_super_init_raises_with_fix() -> None:
    with pytest.raises(ConfigError, match=r"super\(\).__init__\(factory, parent, name\)"):
        node_of(WithoutSuperFactory())


class HandlingLoopFactory(FunctionLoopFactory):
    def get(self, parent: Node) -> Any:
        loop = super().get(parent)
        loop.task_handlers = {TaskType.event: lambda task, task_id: None}
        return loop


def test_loop_with_handlers_raises_config_error() -> None:
    with pytest.raises(
        ConfigError, match=r"Loop 'ticker' of role 'r' registers handlers(.|\n)*into an endpoint: a replay"
    ):
        node_of(HandlingLoopFactory())


# Failures


def boom(*args: Any) -> None:
    raise ZeroDivisionError("the student's own mistake")


LINE = 'raise ZeroDivisionError("the student\'s own mistake")'


def failing(step: str) -> list[Any]:
    if step == "handler":
        return [
            FunctionEndpointFactory(
                {(TaskType.event, "go"): boom}, "culprit", begin=lambda part: part.schedule(tasks.event("go"))
            )
        ]
    if step in ("setup", "loop"):
        return [FunctionLoopFactory(**{"name": "culprit", step: boom})]
    if step.startswith("loop "):
        return [FunctionLoopFactory(**{"name": "culprit", step.removeprefix("loop "): boom})]
    return [FunctionEndpointFactory(**{"name": "culprit", step: boom})]


STEPS = ["handler", "setup", "loop", "begin", "halt", "terminate", "loop halt", "loop terminate"]


@pytest.mark.parametrize("step", STEPS)
def test_failure_message_has_line_then_error_then_context(step: str) -> None:
    with pytest.raises(ComponentFailedError) as caught:
        node_of(*failing(step), ender(0.1)).loop()
    place, what, where = str(caught.value).split("\n")
    assert place.startswith(("tests/core/test_node.py, line ", "/"))
    assert place.endswith(LINE)
    assert what == "  ZeroDivisionError: the student's own mistake"
    assert "component 'culprit'" in where
    assert isinstance(caught.value.__cause__, ZeroDivisionError) or step not in ("handler", "loop", "setup", "begin")
    assert caught.value.component == "culprit"


@pytest.mark.parametrize("step", STEPS)
def test_any_failure_halts_other_components_in_order(step: str) -> None:
    log: list[str] = []
    halted = FunctionLoopFactory(name="wheels", halt=lambda loop: log.append("wheels.halt"))
    with pytest.raises(ComponentFailedError):
        node_of(logged(log, "a"), halted, *failing(step), logged(log, "z"), ender(0.1)).loop()
    ends = [entry for entry in log if not entry.endswith("begin")]
    z = [] if step in ("begin", "setup") else ["z.halt", "z.terminate"]  # then z has not begun
    assert ends == ["a.halt", "a.terminate", "wheels.halt", *z]


def test_the_message_names_handler_and_task() -> None:
    with pytest.raises(
        ComponentFailedError, match=r"in boom\(\), component 'culprit', while it handled event 'go' at t = 0.000 s"
    ):
        node_of(*failing("handler")).loop()


@pytest.mark.parametrize("step", STEPS)
def test_failure_is_recorded_in_trace(step: str) -> None:
    recorder = FakeRecorder()
    with pytest.raises(ComponentFailedError):
        node_of(*failing(step), ender(0.1), recorder=recorder).loop()
    assert [component for component, _ in recorder.errors] == ["culprit"]
    assert LINE in recorder.errors[0][1]
    assert len(recorder.ends) == 1


def test_a_handler_that_unregisters_itself_and_fails_is_still_named() -> None:
    class Changing(FunctionEndpointFactory):
        def get(self, parent: Node) -> FunctionEndpoint:
            part = super().get(parent)

            def go(task: Task, task_id: Any) -> SomeTasks:
                part.task_handlers.clear()
                raise KeyError("depth")

            part.task_handlers = {(TaskType.event, "go"): go}
            return part

    with pytest.raises(ComponentFailedError, match="component 'part', while it handled event 'go'"):
        node_of(Changing(begin=lambda part: part.schedule(tasks.event("go")))).loop()


def test_scheduling_non_task_raises_at_that_line() -> None:
    with pytest.raises(ComponentFailedError, match=r"part.schedule\(\"go\"\)"):
        node_of(FunctionEndpointFactory(begin=lambda part: part.schedule("go"))).loop()
    with pytest.raises(TaskError, match="'outside' scheduled 'go'"):
        node_of().schedule("go")  # type: ignore[arg-type]


# Inputs and consequences


def test_only_inbox_tasks_are_recorded_as_inputs() -> None:
    recorder = FakeRecorder()
    begins = FunctionEndpointFactory(
        {(TaskType.event, "outer"): lambda task, task_id: [tasks.event("inner"), tasks.terminate("done")]},
        begin=lambda part: part.schedule(tasks.event("begun")),
    )
    node = node_of(
        begins, FunctionLoopFactory(lambda loop: loop.store_data("depth", 1), "sensor", 10), recorder=recorder
    )
    node.schedule(tasks.event("outer"))
    node.loop()
    assert [(source, task.name) for source, task in recorder.inputs] == [("outside", "outer")]
    assert ("part", [tasks.event("begun")]) in [(component, list(made)) for component, made in recorder.begun_by]


def test_tasks_of_loop_are_inputs_under_its_name() -> None:
    recorder = FakeRecorder()

    def bring(loop: Any) -> None:
        loop.schedule(tasks.event("a"))
        loop.parent.schedule(tasks.event("b"))
        loop.parent.store_data("c", 1)
        loop.stop()

    node_of(FunctionLoopFactory(bring, "sensor"), recorder=recorder).loop()
    assert [(source, task.name) for source, task in recorder.inputs] == [("sensor", name) for name in "abc"]


def test_every_task_refers_to_record_that_caused_it() -> None:
    recorder = FakeRecorder()
    part = FunctionEndpointFactory(
        {(TaskType.event, "a"): lambda task, task_id: tasks.event("b"), (TaskType.event, "b"): lambda t, i: None}
    )
    node = node_of(part, recorder=recorder)
    node.schedule(tasks.event("a"))
    node.loop()
    of_input, of_b = recorder.causes
    assert of_b == of_input + 1  # the record after that of the input is the execution of a, which returned b


# Chance


def draws(extra: int) -> dict[str, list[float]]:
    drawn: dict[str, list[float]] = {"a": [], "b": [], "node": []}

    class Drawing(FunctionEndpointFactory):
        def get(self, parent: Node) -> FunctionEndpoint:
            part = super().get(parent)

            def draw(task: Task, task_id: Any) -> None:
                drawn[self.name].extend(part.rng.random() for _ in range(1 + (extra if self.name == "a" else 0)))
                drawn["node"].append(parent.rng.random())

            part.task_handlers = {(TaskType.event, "draw"): draw}
            return part

    ticker = FunctionLoopFactory(lambda loop: loop.schedule(tasks.event("draw")), rate_hz=10)
    node_of(Drawing(name="a"), Drawing(name="b"), ticker, ender(0.5), seed=7).loop()
    return drawn


def test_extra_draw_does_not_shift_random_numbers_of_other_component() -> None:
    assert draws(extra=1)["b"] == draws(extra=0)["b"]
    assert draws(extra=1)["a"] != draws(extra=0)["a"]


def test_node_rng_in_handler_equals_component_rng() -> None:
    mine = rng_for(component_seed(7), "b")
    drawn = draws(extra=0)
    expected = [mine.random() for _ in range(2)]
    assert [drawn["b"][0], drawn["node"][1]] == expected


# Diagnostics at the end of a run (`run_diagnostics`)


def notes_of(*factories: Any) -> list[str]:
    node = node_of(*factories, ender(0.1))
    node.loop()
    return node.notes


def test_unhandled_event_is_reported_with_nearest_name() -> None:
    sender = FunctionEndpointFactory(
        {(TaskType.event, "landed"): lambda t, i: None}, begin=lambda p: p.schedule(tasks.event("landd"))
    )
    unhandled, never_called = notes_of(sender)
    assert unhandled == "No component handled event 'landd'; did you mean 'landed'? Handlers wait for: landed."
    assert "'part' waits for event 'landed', which was never sent; 'landd' was sent" in never_called
    assert never_called.endswith("but no handler waits for it: spell both alike.")  # either may be the misspelt one


def test_handled_page_never_stored_is_reported_with_nearest_name() -> None:
    waits = FunctionEndpointFactory(
        {(TaskType.process_data, "motor_sped"): lambda t, i: None}, begin=lambda p: p.store_data("motor_speed", 1)
    )
    (note,) = notes_of(waits)
    assert "'part' waits for process_data 'motor_sped', which was never stored; 'motor_speed' was stored" in note
    assert "test_node.py, line " in note


def test_handler_of_unprocessed_page_is_reported_with_get_data() -> None:
    waits = FunctionEndpointFactory(
        {(TaskType.process_data, "depth"): lambda t, i: None},
        begin=lambda p: p.schedule(p.store_data_task("depth", 1.0, process=False)),
    )
    (note,) = notes_of(waits)
    assert "without a task (process=False)" in note
    assert "self.get_data('depth')" in note


def notes_of_failed(*factories: Any) -> list[str]:
    node = node_of(*factories, ender(0.1))
    with pytest.raises(ComponentFailedError):
        node.loop()
    return node.notes


def test_failed_setup_reports_no_missing_pages() -> None:
    def fail(loop: Any) -> None:
        raise ValueError("no such wire")

    waits = {(TaskType.process_data, "motor_sped"): lambda t, i: None}
    stores = FunctionEndpointFactory(waits, begin=lambda part: part.store_data("motor_speed", 1))
    assert notes_of_failed(stores, FunctionLoopFactory(setup=fail, name="wire")) == []
    assert notes_of_failed(FunctionEndpointFactory(waits), FunctionLoopFactory(loop=fail, name="wire")) == []
    (note,) = notes_of_failed(stores, FunctionLoopFactory(loop=fail, name="wire"))
    assert "motor_sped" in note, "it ran, and so this may be the reason"


class Idle(Endpoint):
    pass


class Greeter(Endpoint):
    def begin(self) -> None:
        self.schedule(tasks.event("hello"))


def test_endpoint_without_handlers_or_begin_is_reported() -> None:
    receiver = FunctionEndpointFactory({TaskType.event: lambda task, task_id: None})
    assert notes_of(Idle.factory("sleeper"), Greeter.factory(), receiver) == [
        "Endpoint 'sleeper' has no handlers, so nothing calls it; set self.task_handlers = {...} in its __init__."
    ]


def test_endpoint_that_removed_its_handlers_is_not_reported() -> None:
    class Once(Idle):
        def __init__(self, factory: EndpointFactory, parent: Node, name: str) -> None:
            super().__init__(factory, parent, name)
            self.task_handlers = {(TaskType.event, "hello"): self.on_hello}

        def on_hello(self, task: Any, task_id: Any) -> None:
            self.task_handlers.clear()

    assert notes_of(Greeter.factory(), Once.factory()) == []


@pytest.mark.parametrize("step", ["halt", "terminate"])
def test_task_scheduled_in_halt_is_reported_as_too_late(step: str) -> None:
    late: dict[str, Any] = {step: lambda part: part.schedule([tasks.event("bye"), tasks.event("now")])}
    (bye, now) = notes_of(FunctionEndpointFactory({TaskType.event: lambda task, task_id: None}, "pilot", **late))
    assert bye.startswith("'pilot' scheduled event 'bye' while it was halted, and no task comes after that.")
    assert now.startswith("'pilot' scheduled event 'now' while")


def test_task_returned_by_terminate_handler_is_executed() -> None:
    received: list[str] = []
    sender = FunctionEndpointFactory({TaskType.terminate: lambda task, task_id: tasks.event("bye")}, "pilot")
    receiver = FunctionEndpointFactory({(TaskType.event, "bye"): lambda task, task_id: received.append("bye")}, "shore")
    assert notes_of(sender, receiver) == []
    assert received == ["bye"]


def test_requested_page_never_stored_is_reported_once() -> None:
    asks = FunctionLoopFactory(lambda loop: loop.get_data("dpth"), rate_hz=100)
    (note,) = notes_of(asks, FunctionEndpointFactory(begin=lambda part: part.store_data("depth", 1)))
    line, words = note.split("\n  ")
    assert "test_node.py, line " in line
    assert words == "Page 'dpth' was requested but never stored; did you mean 'depth'? Stored were: depth."


def test_page_stored_after_request_is_not_reported() -> None:
    late = FunctionLoopFactory(lambda loop: loop.get_data("x") or loop.store_data("x", 1), rate_hz=50)
    assert notes_of(late) == []


def test_growing_queue_is_reported() -> None:
    flood = FunctionLoopFactory(lambda loop: loop.schedule([tasks.event("x")] * (OVERLOAD_TASKS + 5)), rate_hz=1)
    (note,) = notes_of(flood, FunctionEndpointFactory({TaskType.event: lambda t, i: None}))
    assert note.startswith(f"Up to {OVERLOAD_TASKS + 5} tasks waited at a time")
