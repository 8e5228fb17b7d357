"""Rollback: new code that fails in its first calls leaves its place to the old code, with the state that it had."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim import (
    Config,
    FakeActuator,
    MemoryLink,
    Node,
    SimRunner,
    SocketsPair,
    Task,
    TaskType,
    WatchLoopFactory,
    tasks,
)
from snr_sim.core.reload.rollback import PROBATION_CALLS, PROBATION_S
from snr_sim.core.reload.state_snapshot import Snapshot
from snr_sim.devices.commands import ActuatorLoopFactory
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.prelude.signals import EngineCommand
from snr_sim.scenario.library import load_program
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory
from tests.core.test_reload import LOOP, Student, outcome, reload, run, run_on_the_wall_clock, student, thrust_task

__all__ = ["student"]

loops: Any = load_program(str(Path(__file__).parent / "process_loops.py"))

PILOT = """
    from snr_sim import Endpoint, EndpointFactory, TaskType

    class Law:
        gain = 1

    class Pilot(Endpoint):
        def __init__(self, factory, parent, name):
            super().__init__(factory, parent, name)
            self.count = 0
            self.task_handlers = {(TaskType.event, "fly"): self.on_fly}

        def begin(self):
            self.factory.log.append("begun")

        def on_fly(self, task, task_id):
            self.count += 1
            self.factory.moved += 1
            self.factory.law.gain += 1
            self.factory.log.append("moved")
            return self.store_data_task("thrust", [self.count, self.factory.moved, self.factory.law.gain])

        def halt(self):
            self.factory.log.append("halted")

    class PilotFactory(EndpointFactory):
        def __init__(self, name="pilot"):
            super().__init__()
            self.name, self.moved, self.law, self.log = name, 0, Law(), []

        def get(self, parent):
            return Pilot(self, parent, self.name)
"""
ANSWER = 'return self.store_data_task("thrust"'
FAILING = PILOT.replace(ANSWER, f"self.missing()\n            {ANSWER}")


@pytest.mark.parametrize(
    ("broken", "line", "what"),
    [
        ("self.missing()", "self.missing()", "AttributeError: 'Pilot' object has no attribute 'missing'"),
        ("raise SystemExit", "raise SystemExit", "SystemExit: "),
        (
            "return 'thrust'",
            "def on_fly(self, task, task_id):",
            "'pilot.on_fly' returned 'thrust', which is not a task.",
        ),
    ],
)
def test_new_code_that_fails_leaves_its_task_to_the_old_code_and_its_state(
    student: Student, broken: str, line: str, what: str
) -> None:
    factory = student.load(PILOT).PilotFactory()
    law, log = factory.law, factory.log
    change = reload(student, PILOT.replace(ANSWER, f"{broken}\n            {ANSWER}"))
    node, thrusts = run([factory], [thrust_task, thrust_task, change, thrust_task, thrust_task])
    assert thrusts == [[1, 1, 2], [2, 2, 3], [3, 3, 4], [4, 4, 5]]
    assert factory.law is law
    assert factory.log is log
    assert log == ["begun", "moved", "moved", "halted", "begun", "moved", "moved", "halted"]
    page = outcome(node)
    assert (page["component"], page["ok"], page["created"]) == ("pilot", False, [])
    first, *rest = page["message"].splitlines()
    assert first.endswith(f": {line}")
    assert "pilot.py, line " in first
    assert rest[:3] == [
        f"  {what}",
        "  in on_fly(), component 'pilot', while it handled event 'fly' at t = 4.000 s",
        "  1.000 s after its reload, which was rolled back: pilot as before it.",
    ]
    assert rest[3].startswith("  Try: ")
    assert node.notes == [page["message"]]


def test_rolled_back_file_can_be_repaired_and_reloaded(student: Student) -> None:
    factory = student.load(PILOT).PilotFactory()
    repaired = reload(student, PILOT.replace("+= 1", "+= 10"))
    _, thrusts = run([factory], [thrust_task, reload(student, FAILING), thrust_task, repaired, thrust_task])
    assert thrusts == [[1, 1, 2], [2, 2, 3], [10, 12, 13]]


def test_rollback_of_two_unproven_reloads_restores_first_code(student: Student) -> None:
    factory = student.load(PILOT).PilotFactory()
    worse = reload(student, FAILING.replace("missing", "absent"))
    _, thrusts = run([factory], [thrust_task, reload(student, FAILING), worse, thrust_task, thrust_task])
    assert thrusts == [[1, 1, 2], [2, 2, 3], [3, 3, 4]]


def test_rollback_stops_at_code_that_passed_probation(student: Student) -> None:
    factory = student.load(PILOT).PilotFactory()
    faster = reload(student, PILOT.replace("self.count += 1", "self.count += 10"))
    many = [lambda: [thrust_task()] * PROBATION_CALLS] * 5
    never_called = reload(student, PILOT)
    _, thrusts = run([factory], [never_called, faster, *many, reload(student, FAILING), thrust_task])
    assert thrusts[-2:] == [[10 * 5 * PROBATION_CALLS, 500, 501], [10 * 5 * PROBATION_CALLS + 10, 501, 502]]


@pytest.mark.parametrize(("seconds", "calls"), [(int(PROBATION_S) - 2, 2 * PROBATION_CALLS), (60, PROBATION_CALLS - 2)])
def test_new_code_is_on_probation_for_three_seconds_and_a_hundred_calls(
    student: Student, seconds: int, calls: int
) -> None:
    factory = student.load(PILOT).PilotFactory()
    late = PILOT.replace(ANSWER, f"if self.count > {calls}: self.missing()\n            {ANSWER}")
    steps: list[Callable[[], Any]] = [
        reload(student, late),
        lambda: [thrust_task()] * calls,
        *[lambda: None] * (seconds - 1),
    ]
    node, thrusts = run([factory], [*steps, thrust_task])
    assert thrusts[-1] == [1, 1, 2]
    assert not outcome(node)["ok"]


def test_failure_after_probation_ends_the_run(student: Student) -> None:
    factory = student.load(PILOT).PilotFactory()
    late = PILOT.replace(ANSWER, f"if self.count > {2 * PROBATION_CALLS}: self.missing()\n            {ANSWER}")
    many = [lambda: [thrust_task()] * PROBATION_CALLS, *[lambda: None] * 3]
    with pytest.raises(ComponentFailedError, match="missing"):
        run([factory], [reload(student, late), *many, *many, thrust_task])


def test_old_code_that_fails_too_ends_the_run_with_its_own_line(student: Student) -> None:
    odd = PILOT.replace(ANSWER, f"if task.val_list[0] == 7: self.absent()\n            {ANSWER}")
    factory = student.load(odd).PilotFactory()
    with pytest.raises(ComponentFailedError, match=r"pilot.py, line 20\n  AttributeError: .* 'absent'\n"):
        run([factory], [reload(student, FAILING), lambda: thrust_task(7)])


@pytest.mark.parametrize("new", [FAILING, FAILING.replace("missing", "missing(")])
def test_error_in_old_code_shows_old_source_line(student: Student, new: str) -> None:
    odd = PILOT.replace(ANSWER, f"if task.val_list[0] == 7: self.absent()\n            {ANSWER}")
    factory = student.load(odd).PilotFactory()
    saved = [lambda: student.save("\n" + new) and None, lambda: None, lambda: thrust_task(7)]
    with pytest.raises(ComponentFailedError, match=r"pilot.py, line 20: if task.val_list\[0\] == 7: self.absent\(\)"):
        run([factory, WatchLoopFactory()], saved, until_s=5.0)


def test_rollback_restores_all_components_of_reload(student: Student) -> None:
    module = student.load(PILOT)
    one, two = module.PilotFactory("one"), module.PilotFactory("two")
    received: list[str] = []
    listener = FunctionEndpointFactory({(TaskType.event, "fly"): lambda task, task_id: received.append("ear")}, "ear")
    failing = FAILING.replace("self.missing()", "if self.name == 'one': self.missing()")
    node, thrusts = run([one, two, listener], [thrust_task, reload(student, failing, "one", "two"), thrust_task])
    assert thrusts == [[1, 1, 2]] * 2 + [[2, 2, 3]] * 2
    assert received == ["ear", "ear"]
    assert "rolled back: one, two as before it." in outcome(node)["message"]


MAKING_TASKS = PILOT.replace("import Endpoint, EndpointFactory", "import Endpoint, EndpointFactory, Page, Task, tasks")


@pytest.mark.parametrize(
    ("made", "what"),
    [
        ("tasks.event(5)", "An event's name is 5, which is not text."),
        ("Task(TaskType.event, 5)", "A task has the name 5, which is not text."),
        ("Task('event', 'go')", "A task has the type 'event'."),
        ("Task(TaskType.event, 'go', None)", "The task event 'go' carries None, which is not a list."),
        ("Task(TaskType.store_page, 'x')", "The task store_page 'x' carries no page."),
        ("Task(TaskType.store_page, 'x', [5])", "A store_page task carries 5, which is not a page."),
        ("Task(TaskType.store_page, 'x', [Page(5, 1, 'r_node', 0.0)])", "A page has the key 5, which is not text."),
        ("[tasks.event('go')] * 1001", "'pilot' has made 1001 tasks in one call, most of them event 'go'."),
    ],
)
def test_new_code_that_makes_tasks_which_the_node_cannot_execute_is_rolled_back(
    student: Student, made: str, what: str
) -> None:
    factory = student.load(MAKING_TASKS).PilotFactory()
    change = reload(student, MAKING_TASKS.replace(ANSWER, f"return {made}\n            {ANSWER}"))
    node, thrusts = run([factory], [thrust_task, change, thrust_task, thrust_task], max_tasks_per_moment=1000)
    assert thrusts == [[1, 1, 2], [2, 2, 3], [3, 3, 4]]
    lines = outcome(node)["message"].splitlines()
    assert f"  {what}" in lines
    assert "  1.000 s after its reload, which was rolled back: pilot as before it." in lines


ADDING = (
    MAKING_TASKS
    + """
    class Late(Endpoint):
        def __init__(self, factory, parent, name):
            super().__init__(factory, parent, name)
            self.task_handlers = {(TaskType.event, "late"): self.on_late}

        def on_late(self, task, task_id):
            self.missing()

    class LateFactory(EndpointFactory):
        def get(self, parent):
            return Late(self, parent, "late")
"""
)


@pytest.mark.parametrize("then", ["return tasks.event('late')", "self.missing()"])
def test_component_that_new_code_adds_is_on_probation_with_it(student: Student, then: str) -> None:
    factory = student.load(ADDING).PilotFactory()
    is_own_failure = then.startswith("return")
    adds = f"if self.count > 2: {then}\n            return tasks.add_component(LateFactory())"
    change = reload(student, ADDING.replace(ANSWER, f"self.count += 1\n            {adds}\n            {ANSWER}"))
    node, thrusts = run([factory], [thrust_task, change, thrust_task, thrust_task])
    assert list(node.components) == ["node_core", "pilot"]
    message = outcome(node)["message"]
    assert "rolled back: pilot as before it.\n  'late', which its code had added, was removed." in message
    assert ("in on_late(), component 'late'" in message) == is_own_failure
    assert len(thrusts) == (1 if is_own_failure else 2)


def test_component_that_was_removed_since_does_not_come_back(student: Student) -> None:
    module = student.load(PILOT)
    one, two = module.PilotFactory("one"), module.PilotFactory("two")
    steps = [reload(student, FAILING, "one", "two"), lambda: tasks.remove_component("two"), thrust_task]
    node, thrusts = run([one, two], steps)
    assert thrusts == [[1, 1, 2]]
    assert list(node.components) == ["node_core", "one"]
    assert two.log[-1] == "halted"


FAILING_LOOP = LOOP.replace("self.factory.count += 1", "self.factory.count += 100\n            self.missing()")


def test_loop_that_fails_in_its_first_ticks_leaves_its_place_to_the_old_one(student: Student) -> None:
    factory = student.load(LOOP).CounterFactory()
    node, counts = run([factory], [reload(student, FAILING_LOOP, "counter")], 0.25, until_s=0.5)
    assert counts == [1, 2, 3, 4, 5, 6]
    assert "rolled back: counter as before it." in outcome(node)["message"]
    assert outcome(node)["message"].splitlines()[0].endswith(": self.missing()")
    assert factory.log == ["setup", "halt", "terminate", "setup", "halt", "terminate"]


MAKING_LOOP = LOOP.replace("import Loop, LoopFactory", "import Loop, LoopFactory, Task, TaskType, tasks")


@pytest.mark.parametrize(
    ("step", "line", "what"),
    [
        ("self.schedule(tasks.event(5))", "self.schedule(tasks.event(5))", "An event's name is 5"),
        ("return Task(TaskType.store_page, 'x', [5])", "def loop(self):", "A store_page task carries 5"),
        ("return [tasks.event('go')] * 1001", "def loop(self):", "'counter' has made 1001 tasks in one call"),
        ("[self.schedule(tasks.event('go')) for _ in range(1001)]", "def loop(self):", "'counter' has made 1002 tasks"),
        (
            "self.next_tick_at_s = 'soon'",
            "self.next_tick_at_s = 'soon'",
            "next_tick_at_s = 'soon', which is not a time",
        ),
        ("self.next_tick_at_s = float('nan')", "float('nan')", "next_tick_at_s = nan, which is not a time."),
        ("self.next_tick_at_s = 0.0", "self.next_tick_at_s = 0.0", "loop 'counter', whose next_tick_at_s is not later"),
        ("self.next_tick_at_s = 0.0; return", "def loop(self):", "After each of 1000 ticks in a row"),
    ],
)
def test_loop_whose_new_code_lets_time_stand_still_or_makes_no_tasks_is_rolled_back(
    student: Student, step: str, line: str, what: str
) -> None:
    factory = student.load(MAKING_LOOP).CounterFactory()
    before = "self.factory.count += 1\n"
    change = reload(student, MAKING_LOOP.replace(before, f"{before}            {step}\n"), "counter")
    node, counts = run([factory], [change], 0.25, until_s=0.5, max_tasks_per_moment=1000)
    message = outcome(node)["message"]
    assert message.splitlines()[0].endswith(line)
    assert what in message
    assert "rolled back: counter as before it." in message
    assert counts[-2:] == [5, 6]


def test_loop_that_fails_later_ends_the_run(student: Student) -> None:
    factory = student.load(LOOP).CounterFactory()
    late = LOOP.replace("+= 1", "+= 1\n            if self.get_time_s() > 4.0: self.missing()")
    with pytest.raises(ComponentFailedError, match="missing"):
        run([factory], [reload(student, late, "counter")], 0.25, until_s=5.0)


@pytest.mark.parametrize("values", [[], [1], ["pilot", 1, "why"], ["pilot", "1", 2], [["pilot"], 1, "why"]])
def test_roll_back_task_without_probation_changes_nothing(values: list[Any]) -> None:
    node, _ = run([FunctionEndpointFactory(name="pilot")], [lambda: tasks.event("roll_back", values), lambda: None])
    assert node.get_page("reload") is None
    assert list(node.components) == ["node_core", "pilot"]


@pytest.mark.slow
def test_loop_on_a_thread_that_fails_in_its_first_ticks_leaves_its_place_too(student: Student) -> None:
    factory = student.load(LOOP).CounterFactory()
    change = reload(student, FAILING_LOOP, "counter")
    node = run_on_the_wall_clock(factory, change, *[lambda: tasks.event("nothing")] * 5)
    assert node.exit_reason == "done"
    assert factory.count < 100
    assert "rolled back: counter as before it." in outcome(node)["message"]


COMMANDS = """
    from snr_sim import Endpoint, handles

    class Pilot(Endpoint):
        @handles(event="fly")
        def on_fly(self, task):
            return self.store_data_task("engine", {"throttle": 0.5})
"""


@pytest.mark.parametrize("value", ['{"throtle": 0.5}', '{"throttle": float("nan")}', '{"throttle": "half"}', "0.5"])
def test_new_code_that_stores_an_invalid_command_leaves_its_place_to_the_old_code(student: Student, value: str) -> None:
    factory = student.load(COMMANDS).Pilot.factory(name="pilot")
    engine = FakeActuator(EngineCommand, {"throttle": (0.0, 1.0)})
    loop = ActuatorLoopFactory("engine", lambda: engine, 10.0, timeout_s=10.0)
    wrong = reload(student, COMMANDS.replace('{"throttle": 0.5}', value))
    node, _ = run([factory, loop], [thrust_task, wrong, thrust_task, thrust_task], until_s=5.0)
    written = [command.throttle for command in engine.written]
    assert written == [0.5, 0.5]
    message = outcome(node)["message"]
    assert "in loop() of component 'engine_actuator'" in message
    assert "rolled back: pilot as before it." in message
    assert message.splitlines()[0].endswith(f'return self.store_data_task("engine", {value})')


@pytest.mark.parametrize("value", ["object()", "2**70", "'x' * (1 << 21)", "[" * 101 + "]" * 101])
def test_new_code_that_stores_what_a_link_cannot_send_is_rolled_back(student: Student, value: str) -> None:
    factory = student.load(COMMANDS).Pilot.factory(name="pilot")
    link = SocketsPair(("127.0.0.1", 1), name="tether").server("engine")
    wrong = reload(student, COMMANDS.replace('{"throttle": 0.5}', value))
    node, _ = run([factory, link], [thrust_task, wrong, lambda: [thrust_task()] * 2, thrust_task], until_s=5.0)
    message = outcome(node)["message"]
    assert message.splitlines()[0].endswith(f'return self.store_data_task("engine", {value})')
    assert "'link_tether' cannot send page 'engine': " in message
    assert "rolled back: pilot as before it." in message
    assert node.get_data("engine") == {"throttle": 0.5}
    assert node.components["link_tether"].dropped == 2  # type: ignore[attr-defined]


def test_rollback_restores_maker_of_page_though_another_names_its_key(student: Student) -> None:
    factory = student.load(COMMANDS).Pilot.factory(name="pilot")
    other = FunctionEndpointFactory({(TaskType.event, "idle"): lambda task, task_id: print("engine")}, "other")
    link = SocketsPair(("127.0.0.1", 1), name="tether").server("engine")
    wrong = reload(student, COMMANDS.replace('"engine", {"throttle": 0.5}', '"".join(["en", "gine"]), {2**70}'))
    node, _ = run([factory, other, link], [thrust_task, wrong, thrust_task, thrust_task], until_s=5.0)
    line, *rest = outcome(node)["message"].splitlines()
    assert line.endswith("pilot.py, line 3: class Pilot(Endpoint):")
    assert rest[1] == "  It was stored at t = 3.000 s by component 'pilot'."
    assert "rolled back: pilot as before it." in rest[2]
    assert node.get_data("engine") == {"throttle": 0.5}


def test_new_code_that_stores_what_a_memory_link_cannot_send_is_rolled_back(student: Student) -> None:
    factory = student.load(COMMANDS).Pilot.factory(name="pilot")
    steps = [thrust_task, reload(student, COMMANDS.replace('{"throttle": 0.5}', "{2**70}")), thrust_task, thrust_task]
    keyboard = FunctionLoopFactory(lambda loop: loop.schedule(steps.pop(0)() if steps else None), rate_hz=1.0)
    link = MemoryLink(["engine"], "robot", "topside")
    runner = SimRunner(Config(factories={"robot": [factory, keyboard], "topside": []}), links=[link], until_s=5.0)
    runner.run()
    message = outcome(runner.nodes["robot"])["message"]
    assert "The link from 'robot' to 'topside' cannot send page 'engine': " in message
    assert "rolled back: pilot as before it." in message
    assert runner.nodes["topside"].get_data("engine") == {"throttle": 0.5}
    assert (link.directions[0].sent, link.directions[0].dropped) == (2, 1)


ANSWERING = (
    COMMANDS.replace("from snr_sim import Endpoint, handles", "from snr_sim import Endpoint, handles, tasks")
    + """
        def begin(self):
            return tasks.event("fly")

        @handles("written")
        def on_written(self, command):
            return self.store_data_task("thrust", command)

        @handles("reload")
        def on_reload(self, page):
            return None if page["ok"] else self.store_data_task("thrust", "rolled back")
"""
)


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["thread", "process"])
def test_actuator_names_the_writer_of_an_invalid_command_wherever_it_runs(student: Student, executor: Any) -> None:
    factory = student.load(ANSWERING.replace("0.5}", '"half"}')).Pilot.factory(name="pilot")
    node = Node("r", Config(factories={"r": [factory, loops.EngineFactory(executor)]}))
    with pytest.raises(ComponentFailedError) as failed:
        node.loop()
    line, what, _, stored, *_ = failed.value.message.splitlines()
    assert line.endswith('line 6: return self.store_data_task("engine", {"throttle": "half"})')
    assert what.startswith("  Page 'engine' is not a valid command: throttle is the text 'half'")
    assert stored.endswith(" s by on_fly() of component 'pilot'.")


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["thread", "process"])
def test_actuator_notes_the_line_of_a_clamped_command_wherever_it_runs(student: Student, executor: Any) -> None:
    factory = student.load(ANSWERING.replace("0.5}", "1.5}")).Pilot.factory(name="pilot")
    node = run_on_the_wall_clock([factory, loops.EngineFactory(executor)])
    (note,) = [one for one in node.notes if "was clamped to 1" in one]
    assert note.splitlines()[0].endswith('line 6: return self.store_data_task("engine", {"throttle": 1.5})')


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["thread", "process"])
def test_new_code_whose_command_an_actuator_refuses_is_rolled_back(student: Student, executor: Any) -> None:
    factory = student.load(ANSWERING).Pilot.factory(name="pilot")
    wrong = reload(student, ANSWERING.replace("0.5}", '"half"}'))
    node = run_on_the_wall_clock([factory, loops.EngineFactory(executor)], wrong, thrust_task)
    message = outcome(node)["message"]
    assert "rolled back: pilot as before it." in message
    assert message.splitlines()[0].endswith('return self.store_data_task("engine", {"throttle": "half"})')
    assert node.get_data("written") == {"throttle": 0.5}


@pytest.mark.slow
def test_new_code_whose_page_a_process_cannot_get_is_rolled_back(student: Student) -> None:
    source = ANSWERING.replace('"engine"', '"question"').replace('"written"', '"echo"')
    factory = student.load(source).Pilot.factory(name="pilot")
    wrong = reload(student, source.replace('{"throttle": 0.5}', "object()"))
    node = run_on_the_wall_clock([factory, loops.StepsFactory(loops.echo)], wrong, thrust_task)
    message = outcome(node)["message"]
    assert message.splitlines()[0].endswith('return self.store_data_task("question", object())')
    assert "Loop 'worker' runs in a process of its own" in message
    assert " at 0x" not in message
    assert "rolled back: pilot as before it." in message
    assert node.get_data("echo") == {"throttle": 0.5}


def test_late_page_of_rolled_back_code_is_not_a_failure(student: Student) -> None:
    factory = student.load(PILOT).PilotFactory()
    parts: list[Any] = []
    answers: list[bool] = []

    def blame() -> None:
        failures = [ComponentFailedError("why", suspects=["pilot"], stored_at_s=at_s) for at_s in (2.0, 2.5)]
        answers.extend(map(parts[0].parent.blame_suspects, failures))

    other = FunctionEndpointFactory(name="other", begin=parts.append)
    run([factory, other], [reload(student, FAILING), thrust_task, blame])
    assert answers == [True, False]


@pytest.mark.parametrize("tasks_again", ["task", "[task, task]"])
def test_new_code_with_tasks_without_end_leaves_its_place_to_the_old_code(student: Student, tasks_again: str) -> None:
    factory = student.load(COMMANDS).Pilot.factory(name="pilot")
    endless = reload(student, COMMANDS.replace('self.store_data_task("engine", {"throttle": 0.5})', tasks_again))
    node, _ = run([factory], [endless, thrust_task, lambda: None, thrust_task], max_tasks_per_moment=1000)
    message = outcome(node)["message"]
    assert "pilot.on_fly" in message
    assert "tasks schedule each other without end" in message
    assert "rolled back: pilot as before it." in message
    assert node.get_data("engine") == {"throttle": 0.5}


def test_tasks_without_end_of_old_code_end_the_run_after_a_reload_of_another(student: Student) -> None:
    factory = student.load(PILOT).PilotFactory()
    endless = FunctionEndpointFactory({(TaskType.event, "go"): lambda task, task_id: task}, "endless")
    with pytest.raises(ComponentFailedError, match="tasks schedule each other without end"):
        run([factory, endless], [reload(student, PILOT), lambda: tasks.event("go")], max_tasks_per_moment=1000)


def test_snapshot_restores_in_place_what_attributes_hold() -> None:
    import numpy as np

    class Mine:
        pass

    thing, inner = Mine(), Mine()
    inner.weights = np.zeros(3)  # type: ignore[attr-defined]
    inner.thing = thing  # type: ignore[attr-defined]
    lists: list[Any] = [1, {"a": {2}}, (inner, [3])]
    lists.append(lists)
    vars(thing).update(lists=lists, number=1)
    snapshot = Snapshot(thing, [__name__])
    inner.weights[:] = 7.0  # type: ignore[attr-defined]
    lists[1]["a"].add(9)
    lists[2][1].append(4)
    del lists[0]
    vars(thing).update(lists=[], number=2, more=3)
    snapshot.restore()
    assert vars(thing) == {"lists": lists, "number": 1}
    assert lists[:2] == [1, {"a": {2}}]
    assert lists[2] == (inner, [3])
    assert list(inner.weights) == [0.0, 0.0, 0.0]  # type: ignore[attr-defined]


def test_handlers_that_are_not_on_probation_are_called_directly() -> None:
    handlers: dict[Any, Any] = {(TaskType.event, "fly"): lambda task, task_id: None}
    node, _ = run([FunctionEndpointFactory(handlers)], [thrust_task])
    ((_, handler, _, _),) = node.machine.lookup.find(Task(TaskType.event, "fly"))
    assert handler is handlers[TaskType.event, "fly"]
