"""Hot reload: new code between two tasks, with the factory's state; if it fails in any way, the old code continues."""

import gc
import hashlib
import importlib
import re
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import Any

import pytest

from snr_sim import Config, FakeActuator, Node, Page, SimClock, Task, TaskType, tasks
from snr_sim.core.lockstep import LockStep
from snr_sim.devices.commands import ActuatorLoopFactory
from snr_sim.prelude.signals import EngineCommand
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

PILOT = """
    from snr_sim import Endpoint, EndpointFactory, TaskType

    GAIN = 1

    class Pilot(Endpoint):
        def __init__(self, factory, parent, name):
            super().__init__(factory, parent, name)
            factory.made += 1
            self.task_handlers = {(TaskType.event, "fly"): self.on_fly}

        def on_fly(self, task, task_id):
            return self.store_data_task("thrust", [GAIN * task.val_list[0], self.factory.made])

        def terminate(self):
            self.factory.log.append("terminated")

    class PilotFactory(EndpointFactory):
        def __init__(self, name="pilot"):
            super().__init__()
            self.name = name
            self.made = 0
            self.log = []

        def get(self, parent):
            return Pilot(self, parent, self.name)
"""


class Student:
    """A student who writes files in a folder that Python imports from, and saves them while the robot runs."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def save(self, source: str, name: str = "pilot.py") -> Path:
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(dedent(source).lstrip("\n"), encoding="utf-8")
        return path

    def load(self, source: str, name: str = "pilot.py") -> ModuleType:
        self.save(source, name)
        importlib.invalidate_caches()
        return importlib.import_module(name.removesuffix(".py").replace("/", "."))


@pytest.fixture
def student(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Student]:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    known = set(sys.modules)
    yield Student(tmp_path)
    for name in set(sys.modules) - known:
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def run(
    factories: list[Any],
    steps: list[Callable[[], Any]],
    period_s: float = 1.0,
    until_s: float | None = None,
    recorder: Any = None,
    **bounds: Any,
) -> tuple[Node, list[Any]]:
    """Run a node in virtual time; a step a second does something outside and return what it brings in."""
    clock = SimClock()
    node = Node("r", Config(factories={"r": factories}, **bounds), clock=clock, recorder=recorder)
    seen: list[Any] = []
    for i, step in enumerate(steps, 1):
        clock.call_at(i * period_s, lambda step=step: node.enqueue_input(step(), "keyboard"))  # type: ignore[misc]
    node.datastore.listeners.setdefault("thrust", []).append(lambda page: seen.append(page.data))  # type: ignore[attr-defined]
    LockStep([node], clock, until_s=until_s).run()
    return node, seen


def thrust_task(value: int = 3) -> Task:
    return tasks.event("fly", [value])


def reload(student: Student, source: str, *names: str) -> Callable[[], Task]:
    def step() -> Task:
        student.save(source)
        return tasks.reload_component(*(names or ("pilot",)))

    return step


def outcome(node: Node) -> dict[str, Any]:
    page = node.get_page("reload")
    assert page is not None
    return dict(page.data)


# New code, old state


def test_reload_applies_to_next_task_and_keeps_factory_state(student: Student) -> None:
    factory = student.load(PILOT).PilotFactory()
    node, thrusts = run([factory], [thrust_task, reload(student, PILOT.replace("GAIN = 1", "GAIN = 5")), thrust_task])
    assert thrusts == [[3, 1], [15, 2]]
    assert factory.log == ["terminated", "terminated"]
    assert outcome(node)["ok"]
    assert node.notes == []


def test_reload_page_contains_sha256_of_files(student: Student) -> None:
    factory = student.load(PILOT).PilotFactory()
    node, _ = run([factory], [reload(student, PILOT + "\n")])
    digest = hashlib.sha256((student.folder / "pilot.py").read_bytes()).hexdigest()
    assert outcome(node) == {
        "component": "pilot",
        "ok": True,
        "message": "Recreated: pilot.",
        "created": ["pilot"],
        "sources": {f"{student.folder.name}/pilot.py": digest},
    }


def test_reload_keeps_queued_tasks_in_order(student: Student) -> None:
    factory = student.load(PILOT).PilotFactory()
    change = reload(student, PILOT.replace("GAIN = 1", "GAIN = 5"))
    _, thrusts = run([factory], [lambda: [thrust_task(1), change(), *(thrust_task(i) for i in range(2, 1000))]])
    assert thrusts == [[1, 1], *([5 * i, 2] for i in range(2, 1000))]


# Bad code


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (PILOT.replace("return self", "retrun self"), r"^\S*pilot.py, line 12: retrun self.*\n  SyntaxError"),
        (PILOT.replace("GAIN = 1", "GAIN = 1 / 0"), r"^\S*pilot.py, line 3: GAIN = 1 / 0\n  ZeroDivisionError"),
        (PILOT.replace("GAIN = 1", "raise SystemExit(3)"), r"^\S*pilot.py, line 3: raise SystemExit"),
        (PILOT.replace("factory.made += 1", "factory.mode"), r"^\S*pilot.py, line 8: factory.mode\n  AttributeError"),
        (PILOT.replace("return Pilot(", "Pilot("), r"PilotFactory.get\(\) of role 'r' returned None(.|\n)*return My"),
        (PILOT.replace("return Pilot(self, parent, self.name)", "return 42"), "returned 42, but should return a"),
        (PILOT.replace("parent, self.name", "parent, 'plot'"), "now makes a component 'plot' in the place of 'pilot'"),
        (PILOT.replace("PilotFactory", "PilotFactroy"), "no longer has the class PilotFactory.\n(.|\n)*PilotFactroy"),
        (PILOT.replace('(TaskType.event, "fly")', '("fly", TaskType.event)'), "the two are swapped"),
        (PILOT.replace("EndpointFactory", "LoopFactory"), "should return a Loop"),
        ("", "no longer has the class PilotFactory"),
    ],
)
def test_broken_code_keeps_old_component_and_reports_line(student: Student, source: str, message: str) -> None:
    module = student.load(PILOT)
    factory = module.PilotFactory()
    before = dict(vars(module))
    node, thrusts = run([factory], [thrust_task, reload(student, source), thrust_task])
    assert thrusts == [[3, 1], [3, 1]]
    assert factory.log == ["terminated"]
    assert vars(module) == before
    page = outcome(node)
    assert not page["ok"]
    assert page["created"] == []
    assert node.notes == [page["message"]]
    assert re.search(message, page["message"]), page["message"]
    assert page["message"].endswith("Kept as before: pilot.")


def test_failed_begin_restarts_old_component(student: Student) -> None:
    module = student.load(PILOT + "\n        def begin(self): pass\n")
    factory = module.PilotFactory()
    broken = PILOT.replace("def terminate", "def begin(self):\n            self.missing()\n\n        def terminate")
    node, thrusts = run([factory], [thrust_task, reload(student, broken), thrust_task])
    assert [value for value, _ in thrusts] == [3, 3]
    assert "in begin() of component 'pilot'" in outcome(node)["message"]
    assert "AttributeError" in outcome(node)["message"].splitlines()[1]


def test_broken_file_can_be_repaired_and_reloaded(student: Student) -> None:
    factory = student.load(PILOT).PilotFactory()
    good = PILOT.replace("GAIN = 1", "GAIN = 5")
    _, thrusts = run([factory], [reload(student, "x = ("), reload(student, good), thrust_task])
    assert thrusts == [[15, 2]]


# Names


def test_reload_of_unknown_name_suggests_nearest(student: Student) -> None:
    node, thrusts = run([student.load(PILOT).PilotFactory()], [lambda: tasks.reload_component("pilto"), thrust_task])
    assert "has no component 'pilto'.\n  Try: did you mean 'pilot'?" in node.notes[0]
    assert thrusts == [[3, 1]]


def test_reload_of_node_core_is_rejected(student: Student) -> None:
    node, thrusts = run(
        [student.load(PILOT).PilotFactory()], [lambda: tasks.reload_component("node_core"), thrust_task]
    )
    assert "is the node itself" in node.notes[0]
    assert thrusts == [[3, 1]]


def test_weakness_12_reload_all_does_not_brick_the_node(student: Student) -> None:
    one = student.load(PILOT).PilotFactory()
    two = student.load(PILOT.replace('"fly"', '"other"'), "second.py").PilotFactory("second")
    ended = FunctionEndpointFactory({(TaskType.event, "stop"): lambda task, task_id: tasks.terminate("stopped")})
    changed = reload(student, PILOT.replace("GAIN = 1", "GAIN = 5"), "all")
    node, thrusts = run([one, two, ended], [changed, thrust_task, lambda: tasks.event("stop"), lambda: None])
    assert outcome(node)["created"] == ["pilot", "second", "part"]
    assert thrusts == [[15, 2]]
    assert node.exit_reason == "stopped"


def test_reload_all_reports_failed_component_and_keeps_others(student: Student) -> None:
    one = student.load(PILOT).PilotFactory()
    two = student.load(PILOT.replace('"fly"', '"other"'), "second.py").PilotFactory("second")
    node, thrusts = run(
        [two, one], [lambda: student.save("x = (", "second.py") and None, reload(student, PILOT, "all"), thrust_task]
    )
    assert outcome(node)["created"] == ["pilot"]
    assert "second.py, line 1" in node.notes[0]
    assert "Kept as before: second." in node.notes[0]
    assert thrusts == [[3, 2]]


def test_reload_all_reads_shared_file_once(student: Student) -> None:
    counting = "import builtins\nbuiltins.snr_reads = getattr(builtins, 'snr_reads', 0) + 1\n" + dedent(PILOT)
    module = student.load(counting)
    import builtins

    builtins.snr_reads = 0  # type: ignore[attr-defined]
    node, _ = run([module.PilotFactory(name) for name in "abc"], [reload(student, counting, "all")])
    assert outcome(node)["created"] == ["a", "b", "c"]
    assert builtins.snr_reads == 1  # type: ignore[attr-defined]
    del builtins.snr_reads  # type: ignore[attr-defined]


# Loops


LOOP = """
    from snr_sim import Loop, LoopFactory

    class Counter(Loop):
        def setup(self):
            self.factory.log.append("setup")

        def loop(self):
            self.factory.count += 1
            self.store_data("thrust", self.factory.count)

        def halt(self):
            self.factory.log.append("halt")

        def terminate(self):
            self.factory.log.append("terminate")

    class CounterFactory(LoopFactory):
        def __init__(self):
            super().__init__()
            self.count = 0
            self.log = []

        def get(self, parent):
            return Counter(self, parent, "counter", max_tick_rate_hz=10)
"""


def test_reload_replaces_ticks_of_loop_in_lock_step(student: Student) -> None:
    factory = student.load(LOOP).CounterFactory()
    faster = LOOP.replace("+= 1", "+= 100")
    _, counts = run([factory], [reload(student, faster, "counter")], 0.25, until_s=0.5)
    assert counts == [1, 2, 3, 103, 203, 303]
    assert factory.log == ["setup", "halt", "terminate", "setup", "halt", "terminate"]


def test_failed_setup_keeps_old_loop_in_lock_step(student: Student) -> None:
    factory = student.load(LOOP).CounterFactory()
    broken = LOOP.replace('self.factory.log.append("setup")', "self.port.open()")
    node, counts = run([factory], [reload(student, broken, "counter")], 0.25, until_s=0.5)
    assert counts == [1, 2, 3, 4, 5, 6]
    assert "self.port.open()" in node.notes[0].splitlines()[0]


# Loops on threads


def run_on_the_wall_clock(factories: Any, *steps: Callable[[], Any]) -> Node:
    """Run a node with one factory or several; each page `thrust` has the next step done, and the last one ends it."""
    left = list(steps)

    def on_page(task: Task, task_id: Any) -> Any:
        return left.pop(0)() if left else tasks.finish("done")

    stepper = FunctionEndpointFactory({(TaskType.process_data, "thrust"): on_page})
    more = factories if isinstance(factories, list) else [factories]
    node = Node("r", Config(factories={"r": [stepper, *more]}))
    node.loop()
    return node


@pytest.mark.slow
def test_reload_replaces_loop_on_thread(student: Student) -> None:
    factory = student.load(LOOP).CounterFactory()
    node = run_on_the_wall_clock(factory, reload(student, LOOP.replace("+= 1", "+= 100"), "counter"))
    assert outcome(node)["ok"]
    assert factory.count >= 101
    assert factory.log == ["setup", "halt", "terminate", "setup", "halt", "terminate"]
    assert "counter" not in [thread.name for thread in threading.enumerate()]


@pytest.mark.slow
def test_failed_setup_keeps_old_loop_on_thread(student: Student) -> None:
    factory = student.load(LOOP).CounterFactory()
    broken = LOOP.replace('self.factory.log.append("setup")', "self.port.open()").replace(
        'self.factory.log.append("halt")', "self.port.close()"
    )
    node = run_on_the_wall_clock(factory, reload(student, broken, "counter"), lambda: tasks.event("nothing"))
    assert node.exit_reason == "done"
    assert factory.count >= 3
    assert not outcome(node)["ok"]
    assert any(note.splitlines()[0].endswith("self.port.open()") for note in node.notes)
    assert factory.log == ["setup", "halt", "terminate", "terminate", "setup", "halt", "terminate"]


PROCESS_LOOP = """
    import os

    from snr_sim import Loop, LoopFactory

    class Camera(Loop):
        executor = "process"

        def setup(self):
            self.seen = 0

        def loop(self):
            self.seen += 1
            self.store_data("thrust", ["old", os.getpid()])

    class CameraFactory(LoopFactory):
        def get(self, parent):
            return Camera(self, parent, "camera", 20.0)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("setup", "message"),
    [("self.lens.open()", "self.lens.open()"), ("os._exit(3)", "status 3"), ("exit('no lens')", "no lens")],
)
def test_failed_setup_keeps_old_loop_in_process(student: Student, setup: str, message: str) -> None:
    pages: list[list[Any]] = []

    def on_page(task: Task, task_id: Any) -> Any:
        pages.append(task.val_list[0].data)
        if len(pages) == 1:
            student.save(PROCESS_LOOP.replace("self.seen = 0", setup).replace('"old"', '"new"'))
            return tasks.reload_component("camera")
        return tasks.finish("done") if pages[-1][1] != pages[0][1] else None

    factory = student.load(PROCESS_LOOP).CameraFactory()
    node = Node(
        "r", Config(factories={"r": [FunctionEndpointFactory({(TaskType.store_page, "thrust"): on_page}), factory]})
    )
    node.loop()
    assert node.exit_reason == "done"
    assert {code for code, _ in pages} == {"old"}
    assert not outcome(node)["ok"]
    assert message in outcome(node)["message"]


@pytest.mark.slow
def test_reload_replaces_loop_in_process(student: Student) -> None:
    def on_page(task: Task, task_id: Any) -> Any:
        if task.val_list[0].data[0] == "new":
            return tasks.finish("done")
        student.save(PROCESS_LOOP.replace('"old"', '"new"'))
        return tasks.reload_component("camera")

    factory = student.load(PROCESS_LOOP).CameraFactory()
    node = Node(
        "r", Config(factories={"r": [FunctionEndpointFactory({(TaskType.store_page, "thrust"): on_page}), factory]})
    )
    node.loop()
    assert (node.exit_reason, outcome(node)["ok"]) == ("done", True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("halt", "message"),
    [
        ("self.lens.close()", "self.lens.close()\n  AttributeError"),  # the line that ran, not what is there now
        ("os.kill(os.getpid(), 9)", "was ended by SIGKILL"),
    ],
)
@pytest.mark.parametrize("page", ["reload", "remove_component"])
def test_process_failure_during_removal_is_reported(student: Student, halt: str, message: str, page: str) -> None:
    pages: list[Any] = []

    def on_page(task: Task, task_id: Any) -> Any:
        pages.append(task.val_list[0].data[0])
        if pages == ["old"]:
            student.save(PROCESS_LOOP.replace('"old"', '"new"'))
            return tasks.reload_component("camera") if page == "reload" else tasks.remove_component("camera")
        return tasks.finish("done") if pages[-1] == "new" else None

    def on_report(task: Task, task_id: Any) -> Any:
        return tasks.finish("done") if page == "remove_component" else None

    failing = PROCESS_LOOP.replace("def loop", f"def halt(self):\n            {halt}\n\n        def loop")
    factory = student.load(failing).CameraFactory()
    handlers = {(TaskType.store_page, "thrust"): on_page, (TaskType.store_page, page): on_report}
    node = Node("r", Config(factories={"r": [FunctionEndpointFactory(handlers), factory]}))
    node.loop()
    assert node.exit_reason == "done"
    assert message in node.get_data(page)["message"]
    assert any(message in note for note in node.notes)


@pytest.mark.slow
def test_process_loop_reload_ignores_broken_helper_file(student: Student) -> None:
    def on_page(task: Task, task_id: Any) -> Any:
        if task.val_list[0].data[0] == "new helper":
            return tasks.finish("done")
        student.save("WORD = 'half typ", "lens_helper.py")
        student.save(helped.replace("lens_helper.WORD", '"new " + lens_helper.WORD'))
        return None if node.get_page("reload") is not None else tasks.reload_component("camera")

    def on_reload(task: Task, task_id: Any) -> Any:
        return None if outcome(node)["ok"] else tasks.finish("not reloaded")

    helped = PROCESS_LOOP.replace("import os", "import os\n    import lens_helper").replace('"old"', "lens_helper.WORD")
    student.save("WORD = 'helper'\n", "lens_helper.py")
    factory = student.load(helped).CameraFactory()
    handlers = {(TaskType.store_page, "thrust"): on_page, (TaskType.process_data, "reload"): on_reload}
    node = Node("r", Config(factories={"r": [FunctionEndpointFactory(handlers), factory]}))
    node.loop()
    assert (node.exit_reason, outcome(node)["ok"]) == ("done", True), outcome(node)["message"]


@pytest.mark.slow
def test_failed_halt_of_removed_loop_keeps_other_components(student: Student) -> None:
    loop = FunctionLoopFactory(lambda loop: loop.store_data("thrust", 1), halt=lambda loop: loop.missing())
    node = run_on_the_wall_clock(loop, lambda: [tasks.remove_component("ticker"), tasks.finish("done")])
    assert node.exit_reason == "done"
    assert "in halt() of component 'ticker'" in "".join(node.notes)


# Adding and removing


def logging_part(log: list[str], name: str = "part", handlers: Any = None) -> FunctionEndpointFactory:
    def step(what: str) -> Callable[[Any], None]:
        return lambda part: log.append(f"{part.name} {what}")

    return FunctionEndpointFactory(
        handlers, name, begin=step("began"), halt=step("halted"), terminate=step("terminated")
    )


def test_an_added_component_begins_handles_and_ends_like_the_others() -> None:
    log: list[str] = []
    handlers = {(TaskType.event, "fly"): lambda task, task_id: log.append("flew")}
    node, _ = run([], [thrust_task, lambda: tasks.add_component(logging_part(log, "late", handlers)), thrust_task])
    assert log == ["late began", "flew", "late halted", "late terminated"]
    assert node.get_data("add_component")["created"] == ["late"]


def test_an_added_component_shares_tasks_that_others_have_handled_before() -> None:
    log: list[str] = []

    def part(name: str, task_id: Any) -> FunctionEndpointFactory:
        return FunctionEndpointFactory({task_id: lambda task, task_id: log.append(f"{name} {task.name}")}, name)

    one, every = (TaskType.event, "fly"), TaskType.event
    parts = [part("a", one), part("b", every)]
    steps = [
        thrust_task,
        lambda: tasks.add_component(part("c", one)),
        thrust_task,
        lambda: tasks.add_component(part("d", every)),
        thrust_task,
    ]
    run(parts, steps)
    handled = [entry for entry in log if entry.endswith(" fly")]
    assert handled == ["a fly", "b fly", "a fly", "b fly", "c fly", "a fly", "b fly", "c fly", "d fly"]


def test_add_component_time_is_independent_of_component_count() -> None:
    """Counted in calls of Python's functions, which do not depend on the computer."""

    def calls(count: int) -> int:
        handlers = {(TaskType.event, "fly"): lambda task, task_id: None}
        parts = [FunctionEndpointFactory(handlers, f"part{i}") for i in range(count)]
        node = Node("r", Config(factories={"r": parts}), clock=SimClock())
        node.begin()
        counted = 0

        def count_call(frame: Any, event: str, argument: Any) -> None:
            nonlocal counted
            counted += 1

        gc.collect()  # what other tests left would be collected meanwhile, and weak references then call functions
        gc.disable()
        try:
            for i in range(2):  # first what is looked at once
                node.schedule(tasks.add_component(FunctionEndpointFactory(handlers, f"late{i}")))
                sys.setprofile(count_call if i else None)
                node.run_ready()
        finally:
            sys.setprofile(None)
            gc.enable()
        assert node.get_data("add_component")["ok"]
        return counted

    assert calls(1000) == calls(10)


def test_component_added_without_start_only_handles_tasks() -> None:
    log: list[str] = []
    handlers = {(TaskType.event, "fly"): lambda task, task_id: log.append("flew")}
    run([], [lambda: tasks.add_component(logging_part(log, "late", handlers), start_component=False), thrust_task])
    assert log == ["flew"]


def test_an_added_loop_ticks_and_its_pages_are_inputs() -> None:
    late = FunctionLoopFactory(lambda loop: loop.store_data("thrust", loop.get_time_s()), rate_hz=10.0)
    _, seen = run([], [lambda: tasks.add_component(late)], 0.25, until_s=0.5)
    assert seen == [0.25, 0.35, 0.45]


def test_removed_component_is_halted_and_its_handlers_are_removed() -> None:
    log: list[str] = []
    handlers = {TaskType.event: lambda task, task_id: log.append(task.name)}
    factory = logging_part(log, "part", handlers)
    node, _ = run([factory], [lambda: [tasks.event("a"), tasks.remove_component("part"), tasks.event("b")]])
    assert log == ["part began", "a", "remove_component", "part halted", "part terminated"]
    assert list(node.components) == ["node_core"]


def test_remove_endpoint_task_removes_component() -> None:
    node, _ = run([FunctionEndpointFactory()], [lambda: tasks.event(tasks.REMOVE_ENDPOINT_TASK_NAME, ["part"])])
    assert list(node.components) == ["node_core"]


def test_a_component_can_remove_itself() -> None:
    log: list[str] = []
    handlers = {(TaskType.event, "fly"): lambda task, task_id: tasks.remove_component("part")}
    run([logging_part(log, "part", handlers)], [thrust_task, thrust_task])
    assert log == ["part began", "part halted", "part terminated"]


def test_a_removed_loop_stops_ticking_and_is_halted() -> None:
    log: list[str] = []
    loop = FunctionLoopFactory(
        lambda loop: loop.store_data("thrust", 1), rate_hz=10.0, halt=lambda loop: log.append("halted")
    )
    _, seen = run([loop], [lambda: tasks.remove_component("ticker")], 0.25, until_s=0.5)
    assert seen == [1, 1, 1]
    assert log == ["halted"]


def test_a_removed_actuator_goes_to_neutral() -> None:
    actuator = FakeActuator(EngineCommand, {"throttle": (0.0, 1.0)})
    thruster = ActuatorLoopFactory("engine", lambda: actuator, 10.0, timeout_s=10.0)
    states: list[bool] = []

    def command() -> Task:
        return Task(TaskType.store_page, "engine", [Page("engine", {"throttle": 0.7}, "test", 0.0)])

    def look() -> None:
        states.append(actuator.is_neutral)

    run([thruster], [command, look, lambda: tasks.remove_component("engine_actuator"), look], 0.25, until_s=1.0)
    assert states == [False, True]


@pytest.mark.parametrize("name", [tasks.REMOVE_ENDPOINT_TASK_NAME, tasks.REMOVE_COMPONENT_TASK_NAME])
@pytest.mark.parametrize("values", [["sockets_loop"], [], [None], [["part"]], [42]])
def test_weakness_10_removing_unknown_component_is_reported(name: str, values: list[Any]) -> None:
    node, _ = run(
        [FunctionEndpointFactory()], [lambda: tasks.event(name, values), lambda: tasks.terminate("done"), lambda: None]
    )
    assert node.exit_reason == "done"
    assert "has no component" in node.notes[0]
    assert list(node.components) == ["node_core", "part"]


def test_repeated_invalid_requests_are_answered_with_limited_notes() -> None:
    wrong = [*(tasks.reload_component(f"{i}" + "x" * 10_000) for i in range(500)), *[tasks.remove_component("y")] * 500]
    node, _ = run([FunctionEndpointFactory()], [lambda: [*wrong, tasks.finish("done")]])
    assert node.exit_reason == "done"
    assert len(node.notes) == 100 + 1  # and that there were so many
    assert max(map(len, node.notes)) < 300


def test_removing_node_core_is_rejected() -> None:
    node, _ = run([FunctionEndpointFactory()], [lambda: tasks.remove_component("node_core")])
    assert "is the node itself" in node.notes[0]
    assert list(node.components) == ["node_core", "part"]


def test_adding_a_second_component_of_a_name_keeps_the_first() -> None:
    log: list[str] = []
    steps = [lambda: tasks.add_component(logging_part(log, "part"))]
    node, _ = run([logging_part(log, "part")], steps)
    assert "A component 'part' is to be added, but there is one: a FunctionEndpoint. It stays." in node.notes[0]
    assert log == ["part began", "part halted", "part terminated"]


@pytest.mark.parametrize("component", [None, 42])
def test_added_factory_without_component_is_reported(component: Any) -> None:
    factory = FunctionEndpointFactory()
    factory.get = lambda parent: component  # type: ignore[method-assign]
    node, _ = run([], [lambda: tasks.add_component(factory), lambda: tasks.terminate("done"), lambda: None])
    assert f"FunctionEndpointFactory.get() of role 'r' returned {component}" in node.notes[0]
    assert node.exit_reason == "done"


def test_non_factory_is_not_added() -> None:
    node, _ = run([], [lambda: tasks.event(tasks.ADD_COMPONENT_TASK_NAME)])
    assert "where a factory belongs" in node.notes[0]


def test_an_added_component_that_cannot_begin_is_halted_and_left_out() -> None:
    log: list[str] = []
    factory = logging_part(log, "late")
    factory.on_begin = lambda part: part.missing()
    node, _ = run([], [lambda: tasks.add_component(factory), lambda: None])
    assert "in begin() of component 'late'" in node.notes[0]
    assert log == ["late halted", "late terminated"]
    assert list(node.components) == ["node_core"]


def test_components_can_be_read_from_thread_during_changes() -> None:
    parts = [FunctionEndpointFactory(name=f"part {i}") for i in range(50)]
    iterator: list[Any] = []

    def look(task: Task, task_id: Any) -> None:
        iterator.append(iter(node.components.values()))

    clock = SimClock()
    node = Node(
        "r",
        Config(factories={"r": [FunctionEndpointFactory({(TaskType.event, "look"): look}, "looking"), *parts]}),
        clock=clock,
    )
    node.enqueue_input([tasks.event("look"), *(tasks.remove_component(f"part {i}") for i in range(50))], "test")
    LockStep([node], clock).run()
    assert len(list(iterator[0])) == 52  # as it was when the looking began
    assert len(node.components) == 2


def test_change_that_fails_again_and_again_is_logged_ten_times(caplog: pytest.LogCaptureFixture) -> None:
    remover = FunctionEndpointFactory(
        {(TaskType.event, "go"): lambda task, task_id: tasks.remove_component("foo")}, "r"
    )
    node = Node("r", Config(factories={"r": [remover]}), clock=SimClock())
    node.begin()
    for _ in range(30):
        node.enqueue_input(tasks.event("go"), "test")
    node.run_ready()
    warnings = [one.getMessage() for one in caplog.records if "no component 'foo'" in one.getMessage()]
    assert len(warnings) == 10
    assert ["More of it" in one for one in warnings] == [False] * 9 + [True]
