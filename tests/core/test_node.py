"""A node's life cycle: creation, begin, run, end; and its messages when a component fails."""

import itertools
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim import Config, Endpoint, EndpointFactory, LoopFactory, Node, SimClock, SomeTasks, Task, TaskType, tasks
from snr_sim.core.node_life import OVERLOAD_TASKS
from snr_sim.core.node_report import MAX_NOTES
from snr_sim.prelude.errors import ComponentFailed, ConfigError, TaskError, UnknownName
from snr_sim.prelude.rng import chance_of, rng_for
from snr_sim.testing.parts import Part, PartFactory, TickerFactory
from snr_sim.testing.witness import Witness


def node_of(*factories: Any, seed: int = 0, recorder: Any = None) -> Node:
    return Node("r", Config(factories={"r": list(factories)}), clock=SimClock(), seed=seed, recorder=recorder)


def ender(after_s: float = 0.0) -> TickerFactory:
    def end(loop: Any) -> None:
        if loop.get_time_s() >= after_s:
            loop.schedule(tasks.terminate("done"))

    return TickerFactory(end, "ender")


def logged(log: list[str], name: str) -> PartFactory:
    def says(step: str) -> Callable[[Part], None]:
        return lambda part: log.append(f"{name}.{step}")

    return PartFactory({}, name, begin=says("begin"), halt=says("halt"), terminate=says("terminate"))


# Life


def test_components_begin_in_order_and_each_is_halted_and_terminated_once() -> None:
    log: list[str] = []
    node_of(logged(log, "a"), logged(log, "b"), ender()).loop()
    assert log == ["a.begin", "b.begin", "a.halt", "a.terminate", "b.halt", "b.terminate"]


def test_a_loop_is_set_up_looped_halted_and_terminated_in_that_order() -> None:
    log: list[str] = []
    steps = {step: (lambda loop, step=step: log.append(step)) for step in ("setup", "halt", "terminate")}
    node_of(TickerFactory(lambda loop: log.append("loop"), rate_hz=10, **steps), ender(0.2)).loop()
    assert log == ["setup", "loop", "loop", "loop", "halt", "terminate"]


def test_a_node_runs_once() -> None:
    node = node_of(ender())
    node.loop()
    with pytest.raises(ConfigError, match="'r_node' has already run"):
        node.loop()


def busy(at: int, then: Callable[[Part], object]) -> PartFactory:
    """A part that asks for its next event in each one, and does something in one of them."""
    count = itertools.count()

    def spin(task: Task, task_id: Any) -> SomeTasks:
        if next(count) == at:
            then(part_of[0])
        return tasks.event("spin")

    part_of: list[Part] = []

    def begin(part: Part) -> None:
        part_of.append(part)
        part.schedule(tasks.event("spin"))

    return PartFactory({(TaskType.event, "spin"): spin}, "busy", begin=begin)


def test_the_terminate_flag_ends_a_node_whose_queue_is_never_empty() -> None:
    node = node_of(busy(100, lambda part: part.parent.set_terminate_flag("enough")))
    node.loop()
    assert node.exit_reason == "enough"
    assert node.machine.executed < 150


def test_of_two_terminate_flags_the_first_names_the_reason() -> None:
    def end(part: Part) -> None:
        part.parent.set_terminate_flag("first")
        part.parent.set_terminate_flag("second")

    node = node_of(busy(3, end))
    node.loop()
    assert node.exit_reason == "first"


def test_a_terminate_flag_that_is_set_before_the_start_ends_the_node_at_once() -> None:
    node = node_of(busy(10_000, lambda part: part.parent.set_terminate_flag("too late")))
    node.set_terminate_flag("before")
    node.loop()
    assert node.exit_reason == "before"


def test_a_halt_that_fails_is_called_halt_and_the_failures_of_others_are_noted() -> None:
    def fail(what: str) -> Callable[[Part], None]:
        def raises(part: Part) -> None:
            raise ValueError(f"{part.name}: {what}")

        return raises

    parts = [PartFactory({}, name, halt=fail("stuck"), terminate=fail("lost")) for name in ("a", "b")]
    node = node_of(*parts, ender())
    with pytest.raises(ComponentFailed, match=r"a: stuck(.|\n)*in halt\(\) of component 'a'") as caught:
        node.loop()
    assert caught.value.step == "halt"
    told = "\n".join(node.notes)
    for words in ("a: lost", "in terminate() of component 'a'", "b: stuck", "in halt() of component 'b'", "b: lost"):
        assert words in told


def test_what_fails_at_the_end_after_another_failure_is_noted() -> None:
    def fail(part: Part) -> None:
        raise ValueError("stuck valve")

    def crash(task: Task, task_id: Any) -> SomeTasks:
        raise KeyError("depth")

    handlers = {(TaskType.event, "go"): crash}
    part = PartFactory(handlers, "part", begin=lambda part: part.schedule(tasks.event("go")), halt=fail)
    node = node_of(part)
    with pytest.raises(ComponentFailed, match="KeyError: 'depth'"):
        node.loop()
    assert "stuck valve" in "".join(node.notes)


def test_notes_have_an_end() -> None:
    node = node_of()
    for i in range(3 * MAX_NOTES):
        node.note(f"number {i}")
    assert len(node.notes) == MAX_NOTES
    assert node.notes[-2:] == [f"number {MAX_NOTES - 2}", "There was more to note, which is left out."]


def test_a_page_that_is_named_as_the_one_before_another_is_noted() -> None:
    def store(part: Part) -> None:
        part.store_data("x", 1)
        part.store_data("x_prev", "mine")
        part.store_data("y_prev", 0)  # of which there is no newest one

    node = node_of(PartFactory({}, begin=store))
    node.loop()
    said = [note for note in node.notes if "is also the name" in note]
    assert len(said) == 1
    assert "Page 'x_prev' was stored, which is also the name of the page before the newest 'x'" in said[0]


def test_a_node_with_nothing_to_do_ends_in_virtual_time_instead_of_waiting_for_ever() -> None:
    node = node_of(PartFactory())
    node.loop()
    assert node.exit_reason == "nothing left to do"


# Made wrongly


def test_an_unknown_role_is_named_with_the_roles_there_are() -> None:
    with pytest.raises(UnknownName, match=r"no role 'tosbide'(.|\n)*did you mean 'topside'"):
        Node("tosbide", Config(factories={"topside": [], "robot": []}))


class Returning(EndpointFactory):
    def __init__(self, component: Any) -> None:
        super().__init__()
        self.component = component

    def get(self, parent: Node) -> Any:
        return self.component


@pytest.mark.parametrize("component", [None, 42])
def test_a_factory_that_makes_no_endpoint_is_named(component: Any) -> None:
    with pytest.raises(
        ConfigError, match=rf"Returning.get\(\) of role 'r' returned {component}(.|\n)*return MyEndpoint"
    ):
        node_of(Returning(component))


def test_a_factory_without_get_says_so() -> None:
    class Unfinished(LoopFactory):
        pass

    with pytest.raises(ConfigError, match=r"Unfinished needs a method get\(self, parent\)"):
        node_of(Unfinished())


@pytest.mark.parametrize("wrong", [PartFactory, None, "part"])
def test_what_is_no_factory_is_refused(wrong: Any) -> None:
    with pytest.raises(ConfigError, match=r"where a factory belongs(.|\n)*list instances"):
        node_of(wrong)


def test_two_components_of_one_name_are_refused() -> None:
    with pytest.raises(ConfigError, match="two components named 'depth': a Part and a Ticker"):
        node_of(PartFactory(name="depth"), TickerFactory(name="depth"))


def test_no_component_may_take_the_name_of_the_nodes_own() -> None:
    with pytest.raises(ConfigError, match="two components named 'node_core'"):
        node_of(PartFactory(name="node_core"))


class WithoutSuper(Endpoint):
    def __init__(self, parent: Node) -> None:
        self.counter = 0


class WithoutSuperFactory(EndpointFactory):
    def get(self, parent: Node) -> Any:
        return WithoutSuper(parent)


def test_an_endpoint_that_forgot_super_init_is_told_so() -> None:
    with pytest.raises(ConfigError, match=r"super\(\).__init__\(factory, parent, name\)"):
        node_of(WithoutSuperFactory())


class HandlingLoopFactory(TickerFactory):
    def get(self, parent: Node) -> Any:
        loop = super().get(parent)
        loop.task_handlers = {TaskType.event: lambda task, task_id: None}
        return loop


def test_a_loop_with_handlers_is_refused_because_a_replay_would_miss_them() -> None:
    with pytest.raises(ConfigError, match=r"Loop 'ticker' of role 'r' registers handlers(.|\n)*an endpoint beside it"):
        node_of(HandlingLoopFactory())


# Failures


def boom(*args: Any) -> None:
    raise ZeroDivisionError("the student's own mistake")


LINE = 'raise ZeroDivisionError("the student\'s own mistake")'


def failing(step: str) -> list[Any]:
    if step == "handler":
        return [
            PartFactory({(TaskType.event, "go"): boom}, "culprit", begin=lambda part: part.schedule(tasks.event("go")))
        ]
    if step in ("setup", "loop"):
        return [TickerFactory(**{"name": "culprit", step: boom})]
    if step.startswith("loop "):
        return [TickerFactory(**{"name": "culprit", step.removeprefix("loop "): boom})]
    return [PartFactory(**{"name": "culprit", step: boom})]


STEPS = ["handler", "setup", "loop", "begin", "halt", "terminate", "loop halt", "loop terminate"]


@pytest.mark.parametrize("step", STEPS)
def test_a_failure_says_the_students_line_first_then_what_then_where(step: str) -> None:
    with pytest.raises(ComponentFailed) as caught:
        node_of(*failing(step), ender(0.1)).loop()
    place, what, where = str(caught.value).split("\n")
    assert place.startswith(("tests/core/test_node.py, line ", "/"))
    assert place.endswith(LINE)
    assert what == "  ZeroDivisionError: the student's own mistake"
    assert "component 'culprit'" in where
    assert isinstance(caught.value.__cause__, ZeroDivisionError) or step not in ("handler", "loop", "setup", "begin")
    assert caught.value.component == "culprit"


@pytest.mark.parametrize("step", STEPS)
def test_whatever_fails_everything_else_is_halted_in_order(step: str) -> None:
    log: list[str] = []
    halted = TickerFactory(name="wheels", halt=lambda loop: log.append("wheels.halt"))
    with pytest.raises(ComponentFailed):
        node_of(logged(log, "a"), halted, *failing(step), logged(log, "z"), ender(0.1)).loop()
    ends = [entry for entry in log if not entry.endswith("begin")]
    z = [] if step in ("begin", "setup") else ["z.halt", "z.terminate"]  # then z has not begun
    assert ends == ["a.halt", "a.terminate", "wheels.halt", *z]


def test_the_message_names_handler_and_task() -> None:
    with pytest.raises(
        ComponentFailed, match=r"in boom\(\), component 'culprit', while it handled event 'go' at t = 0.000 s"
    ):
        node_of(*failing("handler")).loop()


@pytest.mark.parametrize("step", STEPS)
def test_a_failure_stands_in_the_trace(step: str) -> None:
    witness = Witness()
    with pytest.raises(ComponentFailed):
        node_of(*failing(step), ender(0.1), recorder=witness).loop()
    assert [component for component, _ in witness.errors] == ["culprit"]
    assert LINE in witness.errors[0][1]
    assert len(witness.ends) == 1


def test_a_handler_that_unregisters_itself_and_fails_is_still_named() -> None:
    class Changing(PartFactory):
        def get(self, parent: Node) -> Part:
            part = super().get(parent)

            def go(task: Task, task_id: Any) -> SomeTasks:
                part.task_handlers.clear()
                raise KeyError("depth")

            part.task_handlers = {(TaskType.event, "go"): go}
            return part

    with pytest.raises(ComponentFailed, match="component 'part', while it handled event 'go'"):
        node_of(Changing(begin=lambda part: part.schedule(tasks.event("go")))).loop()


def test_scheduling_what_is_no_task_is_refused_where_it_happens() -> None:
    with pytest.raises(ComponentFailed, match=r"part.schedule\(\"go\"\)"):
        node_of(PartFactory(begin=lambda part: part.schedule("go"))).loop()
    with pytest.raises(TaskError, match="'outside' scheduled 'go'"):
        node_of().schedule("go")  # type: ignore[arg-type]


# Inputs and consequences


def test_what_comes_through_the_door_is_an_input_and_the_rest_is_consequence() -> None:
    witness = Witness()
    begins = PartFactory(
        {(TaskType.event, "outer"): lambda task, task_id: [tasks.event("inner"), tasks.terminate("done")]},
        begin=lambda part: part.schedule(tasks.event("begun")),
    )
    node = node_of(begins, TickerFactory(lambda loop: loop.store_data("depth", 1), "sensor", 10), recorder=witness)
    node.schedule(tasks.event("outer"))
    node.loop()
    assert [(source, task.name) for source, task in witness.inputs] == [("outside", "outer")]
    assert ("part", [tasks.event("begun")]) in [(component, list(made)) for component, made in witness.begun_by]


def test_what_a_loop_brings_is_an_input_under_its_name_however_it_brings_it() -> None:
    witness = Witness()

    def bring(loop: Any) -> None:
        loop.schedule(tasks.event("a"))
        loop.parent.schedule(tasks.event("b"))
        loop.parent.store_data("c", 1)
        loop.stop()

    node_of(TickerFactory(bring, "sensor"), recorder=witness).loop()
    assert [(source, task.name) for source, task in witness.inputs] == [("sensor", name) for name in "abc"]


def test_every_task_knows_the_record_that_caused_it() -> None:
    witness = Witness()
    part = PartFactory(
        {(TaskType.event, "a"): lambda task, task_id: tasks.event("b"), (TaskType.event, "b"): lambda t, i: None}
    )
    node = node_of(part, recorder=witness)
    node.schedule(tasks.event("a"))
    node.loop()
    of_input, of_b = witness.causes
    assert of_b == of_input + 1  # the record after that of the input is the execution of a, which returned b


# Chance


def draws(extra: int) -> dict[str, list[float]]:
    drawn: dict[str, list[float]] = {"a": [], "b": [], "node": []}

    class Drawing(PartFactory):
        def get(self, parent: Node) -> Part:
            part = super().get(parent)

            def draw(task: Task, task_id: Any) -> None:
                drawn[self.name].extend(part.rng.random() for _ in range(1 + (extra if self.name == "a" else 0)))
                drawn["node"].append(parent.rng.random())

            part.task_handlers = {(TaskType.event, "draw"): draw}
            return part

    ticker = TickerFactory(lambda loop: loop.schedule(tasks.event("draw")), rate_hz=10)
    node_of(Drawing(name="a"), Drawing(name="b"), ticker, ender(0.5), seed=7).loop()
    return drawn


def test_one_more_draw_in_one_component_does_not_shift_the_chance_of_another() -> None:
    assert draws(extra=1)["b"] == draws(extra=0)["b"]
    assert draws(extra=1)["a"] != draws(extra=0)["a"]


def test_the_nodes_rng_inside_a_handler_is_the_components_own() -> None:
    mine = rng_for(chance_of(7), "b")
    drawn = draws(extra=0)
    expected = [mine.random() for _ in range(2)]
    assert [drawn["b"][0], drawn["node"][1]] == expected


# Diagnostics at the end of a run (`loose_ends`)


def notes_of(*factories: Any) -> list[str]:
    node = node_of(*factories, ender(0.1))
    node.loop()
    return node.notes


def test_an_event_nobody_handles_is_reported_with_the_nearest_name() -> None:
    sender = PartFactory(
        {(TaskType.event, "landed"): lambda t, i: None}, begin=lambda p: p.schedule(tasks.event("landd"))
    )
    unhandled, never_called = notes_of(sender)
    assert unhandled == "Nobody handled event 'landd'; did you mean 'landed'? Handlers wait for: landed."
    assert "'part' waits for event 'landed', which nobody sent; 'landd' was sent" in never_called
    assert never_called.endswith("for which nobody waits: spell both alike.")  # either may be the misspelt one


def test_a_page_waited_for_that_nobody_stores_is_reported_with_the_nearest_name() -> None:
    waits = PartFactory(
        {(TaskType.process_data, "motor_sped"): lambda t, i: None}, begin=lambda p: p.store_data("motor_speed", 1)
    )
    (note,) = notes_of(waits)
    assert "'part' waits for process_data 'motor_sped', which nobody stored; 'motor_speed' was stored" in note
    assert "test_node.py, line " in note


def test_a_handler_of_a_page_that_was_stored_without_a_task_is_told_to_look_it_up() -> None:
    waits = PartFactory(
        {(TaskType.process_data, "depth"): lambda t, i: None},
        begin=lambda p: p.schedule(p.store_data_task("depth", 1.0, process=False)),
    )
    (note,) = notes_of(waits)
    assert "without a task (process=False)" in note
    assert "self.get_data('depth')" in note


def notes_of_failed(*factories: Any) -> list[str]:
    node = node_of(*factories, ender(0.1))
    with pytest.raises(ComponentFailed):
        node.loop()
    return node.notes


def test_a_run_that_a_failed_setup_ends_does_not_tell_what_could_not_come() -> None:
    def fail(loop: Any) -> None:
        raise ValueError("no such wire")

    waits = {(TaskType.process_data, "motor_sped"): lambda t, i: None}
    stores = PartFactory(waits, begin=lambda part: part.store_data("motor_speed", 1))
    assert notes_of_failed(stores, TickerFactory(setup=fail, name="wire")) == []
    assert notes_of_failed(PartFactory(waits), TickerFactory(loop=fail, name="wire")) == []
    (note,) = notes_of_failed(stores, TickerFactory(loop=fail, name="wire"))
    assert "motor_sped" in note, "it ran, and so this may be the reason"


class Idle(Endpoint):
    pass


class Greeter(Endpoint):
    def begin(self) -> None:
        self.schedule(tasks.event("hello"))


class MadeOf(EndpointFactory):
    def __init__(self, kind: type[Endpoint], name: str) -> None:
        super().__init__()
        self.kind, self.name = kind, name

    def get(self, parent: Node) -> Endpoint:
        return self.kind(self, parent, self.name)


def test_an_endpoint_that_nothing_can_call_is_reported_and_one_that_begins_something_is_not() -> None:
    hears = PartFactory({TaskType.event: lambda task, task_id: None})
    assert notes_of(MadeOf(Idle, "sleeper"), MadeOf(Greeter, "greeter"), hears) == [
        "Endpoint 'sleeper' has no handlers, so nothing calls it; set self.task_handlers = {...} in its __init__."
    ]


def test_an_endpoint_that_gave_up_its_handlers_after_its_work_is_not_reported() -> None:
    class Once(Idle):
        def __init__(self, factory: EndpointFactory, parent: Node, name: str) -> None:
            super().__init__(factory, parent, name)
            self.task_handlers = {(TaskType.event, "hello"): self.on_hello}

        def on_hello(self, task: Any, task_id: Any) -> None:
            self.task_handlers.clear()

    assert notes_of(MadeOf(Greeter, "greeter"), MadeOf(Once, "once")) == []


@pytest.mark.parametrize("step", ["halt", "terminate"])
def test_what_is_scheduled_while_halted_is_reported_as_too_late(step: str) -> None:
    late: dict[str, Any] = {step: lambda part: part.schedule([tasks.event("bye"), tasks.event("now")])}
    (bye, now) = notes_of(PartFactory({TaskType.event: lambda task, task_id: None}, "pilot", **late))
    assert bye.startswith("'pilot' scheduled event 'bye' while it was halted, and no task comes after that.")
    assert now.startswith("'pilot' scheduled event 'now' while")


def test_what_a_terminate_handler_returns_is_not_too_late() -> None:
    heard: list[str] = []
    says = PartFactory({TaskType.terminate: lambda task, task_id: tasks.event("bye")}, "pilot")
    hears = PartFactory({(TaskType.event, "bye"): lambda task, task_id: heard.append("bye")}, "shore")
    assert notes_of(says, hears) == []
    assert heard == ["bye"]


def test_a_page_asked_for_that_nobody_stores_is_reported_once() -> None:
    asks = TickerFactory(lambda loop: loop.get_data("dpth"), rate_hz=100)
    (note,) = notes_of(asks, PartFactory(begin=lambda part: part.store_data("depth", 1)))
    line, words = note.split("\n  ")
    assert "test_node.py, line " in line
    assert words == "Page 'dpth' was asked for, but nobody stored it; did you mean 'depth'? Stored were: depth."


def test_a_page_that_only_came_later_is_no_loose_end() -> None:
    late = TickerFactory(lambda loop: loop.get_data("x") or loop.store_data("x", 1), rate_hz=50)
    assert notes_of(late) == []


def test_a_queue_that_grows_is_reported() -> None:
    flood = TickerFactory(lambda loop: loop.schedule([tasks.event("x")] * (OVERLOAD_TASKS + 5)), rate_hz=1)
    (note,) = notes_of(flood, PartFactory({TaskType.event: lambda t, i: None}))
    assert note.startswith(f"Up to {OVERLOAD_TASKS + 5} tasks waited at a time")
