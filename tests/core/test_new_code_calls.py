"""New code that does not return is interrupted and rolled back; so is new code on whose tasks other components fail."""

import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from snr_sim import Config, Node, SimClock, Task, TaskType, tasks
from snr_sim.core import interrupts
from snr_sim.core.interrupts import MAX_ATTEMPTS, graceful_shutdown, interrupt_new_code
from snr_sim.core.reload.new_code_calls import MAX_MADE, NewCodeCalls
from snr_sim.core.reload.rollback import PROBATION_CALLS, PROBATION_S
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.testing.fake_recorder import FakeRecorder
from snr_sim.testing.function_components import FunctionEndpointFactory
from tests.core.test_reload import LOOP, Student, outcome, reload, run, student, thrust_task
from tests.core.test_rollback import PILOT
from tests.core.test_watchdog import Checks

__all__ = ["student"]

WHY = "pilot.py, line 1: while True\n  on_fly() has not returned, and was interrupted.\n  Try: return."
MOVED = 'self.factory.log.append("moved")'


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> Iterator[FunctionEndpointFactory]:
    """Returns a component of a node; `sys.overdue()` interrupts its call of new code, or is false in other code."""
    nodes: list[Any] = []
    monkeypatch.setattr(interrupts, "SIGNALS", 1)  # they are sent by the thread that gets them

    def begin(part: Any) -> None:
        nodes.append(part.parent)
        monkeypatch.setattr(sys, "overdue", partial(interrupt_new_code, part.parent, WHY), raising=False)

    with graceful_shutdown(nodes):
        yield FunctionEndpointFactory(name="watched", begin=begin)


def hanging(source: str, line: str, body: str = "pass") -> str:
    """Return a source with a loop without end before a line, and what is done in it."""
    (before,) = (one for one in source.splitlines() if one.strip() == line)
    indent = before.removesuffix(line)
    loop = f"{indent}import sys\n{indent}while sys.overdue():\n{indent}    {body}\n"
    return source.replace(before, loop + before)


@pytest.mark.parametrize("is_recorded", [False, True])
@pytest.mark.parametrize(
    "body",
    [
        "self.factory.moved += 1",
        "self.store_data('thrust', 'dropped')",
        "self.schedule(tasks.terminate('dropped'))",
        "try: sys.overdue()\n                except Exception: pass",
        "try: sys.overdue()\n                except BaseException: return None",
    ],
)
def test_handler_that_does_not_return_leaves_its_task_to_the_old_code_and_its_state(
    student: Student, watched: FunctionEndpointFactory, body: str, is_recorded: bool
) -> None:
    recorder = FakeRecorder() if is_recorded else None
    source = PILOT.replace("import Endpoint,", "import tasks, Endpoint,")
    factory = student.load(source).PilotFactory()
    change = reload(student, hanging(source, MOVED, body))
    node, thrusts = run([watched, factory], [thrust_task, change, thrust_task, thrust_task], recorder=recorder)
    assert thrusts == [[1, 1, 2], [2, 2, 3], [3, 3, 4]]
    assert factory.log == ["begun", "moved", "halted", "begun", "moved", "moved", "halted"]
    page = outcome(node)
    assert (page["component"], page["ok"]) == ("pilot", False)
    assert page["message"] == WHY.replace(
        "\n  Try: return.", "\n  1.000 s after its reload, which was rolled back: pilot as before it.\n  Try: return."
    )
    if recorder is not None:
        assert [task.val_list for source, task in recorder.inputs if source == "node_core"] == [["pilot.on_fly", WHY]]


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("class Law:", "pilot.py"),
        ("self.count = 0", "pilot.__init__"),
        ('self.factory.log.append("begun")', "pilot.begin"),
    ],
)
def test_reload_of_code_that_does_not_return_fails_and_keeps_the_old_code(
    student: Student, watched: FunctionEndpointFactory, line: str, what: str
) -> None:
    source = PILOT.replace("super().__init__()", "super().__init__()\n            self.extra = 0")
    factory, recorder = student.load(source).PilotFactory(), FakeRecorder()
    state = dict(vars(factory))
    body = "pass" if line.startswith("class") else "factory.extra = 1" if "count" in line else "self.factory.moved = 7"
    change = reload(student, hanging(source, line, body))
    node, thrusts = run([watched, factory], [change, thrust_task], recorder=recorder)
    assert thrusts == [[1, 1, 2]]
    assert vars(factory).keys() == state.keys()
    assert outcome(node)["message"].splitlines()[:2] == WHY.splitlines()[:2]
    assert "Kept as before: pilot." in outcome(node)["message"]
    ((call, why),) = [task.val_list for source, task in recorder.inputs if source == "node_core"]
    assert (call.endswith(what), why) == (True, WHY)


def test_loop_that_does_not_return_in_lock_step_leaves_its_place_to_the_old_one(
    student: Student, watched: FunctionEndpointFactory
) -> None:
    factory = student.load(LOOP).CounterFactory()
    change = reload(
        student, hanging(LOOP, "self.factory.count += 1", "self.store_data('thrust', 'dropped')"), "counter"
    )
    node, counts = run([watched, factory], [change], 0.25, until_s=0.5)
    assert counts == [1, 2, 3, 4, 5, 6]
    assert outcome(node)["message"].startswith(WHY.partition("\n  Try")[0])


def test_code_that_is_not_on_probation_is_not_interrupted(student: Student, watched: FunctionEndpointFactory) -> None:
    late = hanging(PILOT, MOVED, "raise AssertionError")
    factory = student.load(late).PilotFactory()
    many = [lambda: [thrust_task()] * PROBATION_CALLS, *[lambda: None] * int(PROBATION_S)]
    reloaded = PILOT.replace(
        MOVED,
        f"import sys\n            assert self.count < {PROBATION_CALLS + 1} or not sys.overdue()\n            {MOVED}",
    )
    node, _ = run([watched, factory], [thrust_task, reload(student, reloaded), *many, thrust_task])
    assert outcome(node)["ok"]


def test_call_is_interrupted_at_the_line_that_does_not_return(watched: FunctionEndpointFactory) -> None:
    node = Node("r", Config(factories={"r": [watched]}), clock=SimClock())
    node.begin()
    checks = Checks(node)

    def hang() -> None:
        node.machine.running = node.components["watched"]
        checks.pass_by(1.5)
        assert node.machine.guarded_call is not None
        assert node.machine.guarded_call.attempts == 0
        checks.pass_by(10.0)

    with pytest.raises(ComponentFailedError) as failed:
        NewCodeCalls(node).call("pilot.on_fly", "pilot", hang)
    first, what, fix = str(failed.value).splitlines()
    assert first.startswith("tests/core/test_watchdog.py, line ")
    assert what == "  hang() of component 'pilot' has not returned for 4 s at t = 0.000 s, and was interrupted."
    assert fix.startswith("  Try: a handler, and a loop's loop(), does its work once and returns.")
    assert checks.reports == []


def test_code_that_cannot_be_interrupted_is_reported(watched: FunctionEndpointFactory) -> None:
    node = Node("r", Config(factories={"r": [watched]}), clock=SimClock())
    checks = Checks(node)
    node.begin()

    def stubborn() -> None:
        for _ in range(MAX_ATTEMPTS + 5):
            try:
                checks.pass_by(1.0)
            except BaseException:
                continue

    node.machine.running = node.components["watched"]
    with pytest.raises(ComponentFailedError):
        NewCodeCalls(node).call("pilot.on_fly", "pilot", stubborn)
    (report,) = checks.reports
    assert "has not returned for 4 s" in report
    node.machine.running = None


# Tasks of new code on which another component fails

LIFT = """
    from snr_sim import Endpoint, handles, tasks

    class Pilot(Endpoint):
        @handles(event="fly")
        def on_fly(self, task):
            return self.store_data_task("lift", 1)
"""
MADE = 'return self.store_data_task("lift", 1)'


def adding(name: str = "other") -> FunctionEndpointFactory:
    """Return a component that adds one to what it gets, and stores it as 'thrust'."""
    parts: list[Any] = []

    def on_task(task: Task, task_id: Any) -> Any:
        parts[0].store_data("thrust", name)
        return parts[0].store_data_task("thrust", (task.page.data if task.page else task.val_list[0]) + 1)

    handlers: Any = {(TaskType.process_data, "lift"): on_task, (TaskType.event, "lift"): on_task}
    return FunctionEndpointFactory(handlers, name, begin=parts.append)


def listening(received: list[Any]) -> FunctionEndpointFactory:
    handlers: Any = {(TaskType.process_data, "lift"): lambda task, task_id: received.append(task.page.data)}
    return FunctionEndpointFactory(handlers, "listener")


@pytest.mark.parametrize(
    "made",
    [
        'return self.store_data_task("lift", "bad")',
        'self.store_data("lift", "bad")',
        'return tasks.event("lift", ["bad"])',
        'self.schedule([tasks.event("lift", ["bad"])])',
    ],
)
def test_new_code_on_whose_task_another_component_fails_is_rolled_back(student: Student, made: str) -> None:
    factory, received = student.load(LIFT).Pilot.factory(name="pilot"), list[Any]()
    change = reload(student, LIFT.replace(MADE, made))
    steps = [thrust_task, change, thrust_task, thrust_task]
    node, thrusts = run([factory, adding(), listening(received)], steps)
    assert thrusts == ["other", 2, "other", 2]  # nothing of the call that failed
    assert received == ([1, 1] if "event" in made else [1, "bad", 1])
    page = outcome(node)
    assert (page["component"], page["ok"], page["created"]) == ("pilot", False, [])
    kind = "event" if "event" in made else "page"
    line, other, what, where, words, fix = page["message"].splitlines()
    assert line.endswith(f"pilot.py, line 6: {made}")
    assert other.strip().startswith("tests/core/test_new_code_calls.py, line ")
    assert what == '  TypeError: can only concatenate str (not "int") to str'
    assert where.endswith(" 'lift' at t = 3.000 s")
    assert words.startswith(f"  'pilot' has made {kind} 'lift', 1.000 s after its reload, which was rolled back: pilot")
    assert fix.startswith("  Try: ")


def test_late_tasks_of_rolled_back_code_are_dropped_if_others_fail_on_them(student: Student) -> None:
    factory = student.load(LIFT).Pilot.factory(name="pilot")
    change = reload(student, LIFT.replace(MADE, 'return 2 * [self.store_data_task("lift", "bad")]'))
    node, thrusts = run([factory, adding(), adding("next")], [change, thrust_task, thrust_task])
    assert thrusts == ["other", 2, "next", 2]
    assert "'pilot' has made page 'lift' before it was rolled back, so this task" in outcome(node)["message"]


def test_tasks_that_fail_on_a_page_of_new_code_are_dropped_until_it_is_replaced(
    student: Student,
) -> None:
    factory, parts = student.load(LIFT).Pilot.factory(name="pilot"), list[Any]()

    def on_look(task: Task, task_id: Any) -> Any:
        return parts[0].store_data_task("thrust", parts[0].get_data("lift") + 1)

    other = FunctionEndpointFactory({(TaskType.event, "look"): on_look}, "other", begin=parts.append)
    change = reload(student, LIFT.replace(MADE, 'return self.store_data_task("lift", "bad")'))
    look = tasks.event("look")
    node, thrusts = run([factory, other], [change, thrust_task, lambda: [look, look, thrust_task()], lambda: look])
    assert thrusts == [2]
    first, second = node.notes
    assert "'pilot' has made page 'lift', 2.000 s after its reload, which was rolled back" in first
    assert "'pilot' has made page 'lift' before it was rolled back, so this task is dropped." in second


def test_page_that_begin_of_new_code_schedules_counts_as_made_by_it(student: Student) -> None:
    factory = student.load(LIFT).Pilot.factory(name="pilot")
    begin = '        def begin(self):\n            return self.store_data_task("lift", "bad")\n'
    node, thrusts = run([factory, adding()], [reload(student, LIFT + begin), thrust_task])
    assert thrusts == ["other", 2]
    assert "0.000 s after its reload, which was rolled back" in outcome(node)["message"]


def test_new_loop_on_whose_page_another_component_fails_is_rolled_back(student: Student) -> None:
    source = LOOP.replace('"thrust"', '"lift"')
    factory = student.load(source).CounterFactory()
    change = reload(student, source.replace("self.factory.count)", "str(self.factory.count))"), "counter")
    node, thrusts = run([factory, adding()], [change], 0.25, until_s=0.5)
    assert [one for one in thrusts if one != "other"] == [2, 3, 4, 5, 6, 7]
    assert "'counter' has made page 'lift', 0.000 s after its reload" in outcome(node)["message"]


@pytest.mark.parametrize("kind", ["own task", "passed"])
def test_other_component_that_fails_for_itself_ends_the_run(student: Student, kind: str) -> None:
    factory = student.load(LIFT).Pilot.factory(name="pilot")
    steps: list[Callable[[], Any]] = [reload(student, LIFT), lambda: tasks.event("lift", ["bad"])]
    if kind == "passed":
        late = MADE.replace("1)", "'bad' if self.factory.count > 150 else 1)")
        late = f'self.factory.count = getattr(self.factory, "count", 0) + 1\n            {late}'
        steps = [reload(student, LIFT.replace(MADE, late)), *4 * [lambda: 40 * [thrust_task()]]]
    with pytest.raises(ComponentFailedError, match="component 'other'"):
        run([factory, adding()], steps)


def test_other_components_are_called_directly_once_new_code_has_passed(student: Student) -> None:
    factory, other = student.load(LIFT).Pilot.factory(name="pilot"), adding()
    steps = [reload(student, LIFT), *4 * [lambda: 40 * [thrust_task()]]]
    node, _ = run([factory, other], steps)
    ((_, handler, _, _),) = node.machine.lookup.find(Task(TaskType.event, "lift"))
    assert handler is other.handlers[TaskType.event, "lift"]


def test_a_bounded_number_of_tasks_is_remembered() -> None:
    calls = NewCodeCalls(Node("r", Config(factories={"r": []}), clock=SimClock()))
    calls.keep("pilot", [tasks.event("x") for _ in range(2 * MAX_MADE)])
    assert len(calls.made) == MAX_MADE
