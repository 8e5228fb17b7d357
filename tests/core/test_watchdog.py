"""A thread that only reads reports a run that stalls or falls behind, while it does."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, Node, SimClock, SimRunner, SynchronousRunner, Task, TaskType, TestRunner, tasks
from snr_sim.core import lockstep, watchdog
from snr_sim.core.interrupts import LastResort
from snr_sim.core.standstill import SLOW_CHECKS
from snr_sim.core.watchdog import CHECK_PERIOD_S, SAMPLES, UNENDED_AFTER_S, Unended, Watchdog
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, SnrError
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

GO = (TaskType.event, "go")


class Checks:
    """A watchdog without a thread: the test triggers its checks and sets its clock."""

    def __init__(self, node: Node) -> None:
        self.reports: list[str] = []
        self.now_s = 0.0
        self.watchdog = Watchdog([node], now_s=lambda: self.now_s, report=self.reports.append, pause=lambda s: None)
        self.watchdog.begin(sys._getframe(1))

    def pass_by(self, seconds: float, at_each: Callable[[], object] = lambda: None) -> None:
        """Advance the wall time, and let the watchdog poll at its own rate."""
        for _ in range(round(seconds / CHECK_PERIOD_S)):
            at_each()
            self.now_s += CHECK_PERIOD_S
            self.watchdog.check()


def run_with(handler: Callable[[Checks], Any], *, limit_s: float = float("inf"), recorder: Any = None) -> Checks:
    """Run one task whose handler is given the watchdog of its own run."""
    checks: list[Checks] = []

    def on_go(task: Task, task_id: Any) -> Any:
        return handler(checks[0])

    factories = [FunctionEndpointFactory({GO: on_go}, "pilot", begin=lambda part: part.schedule(tasks.event("go")))]
    config = Config(factories={"test": factories}, stall_limit_s=limit_s)
    node = Node("test", config, clock=SimClock(), recorder=recorder)
    checks.append(Checks(node))
    node.begin()
    node.run_ready()
    return checks[0]


@pytest.mark.parametrize("is_recorded", [False, True])
def test_a_handler_that_does_not_return_is_named_with_task_and_line(is_recorded: bool, tmp_path: Path) -> None:
    recorder = None
    if is_recorded:
        whole = Config(factories={"test": []})
        recorder = TraceWriter(tmp_path / FILE_NAME, program_header(["test"], whole, __file__, SimClock()))
    checks = run_with(lambda checks: checks.pass_by(2.5), recorder=recorder)
    if recorder is not None:
        recorder.close()
    (message,) = checks.reports
    assert message.startswith("tests/core/test_watchdog.py, line ")
    assert "on_go() of component 'pilot', which handles event 'go', has not returned for 2 s at t = 0.000 s" in message
    assert "Try: a handler, and a loop's loop(), does its work once and returns." in message


def test_standstill_is_reported_after_2_s_and_every_10_s() -> None:
    checks = run_with(lambda checks: checks.pass_by(35.0))
    assert ["for 2 s" in checks.reports[0], "for 12 s" in checks.reports[1]] == [True, True]
    assert len(checks.reports) == 4


def test_handler_that_returns_in_time_is_not_reported() -> None:
    assert run_with(lambda checks: checks.pass_by(1.5)).reports == []


def test_stopped_process_is_not_reported() -> None:
    def stopped(checks: Checks) -> None:
        checks.now_s += 3600.0
        checks.watchdog.check()

    assert run_with(stopped).reports == []


def test_many_handlers_at_one_instant_report_no_standstill() -> None:
    checks: list[Checks] = []
    left = [20]

    def work(task: Task, task_id: Any) -> Any:
        checks[0].pass_by(0.5)
        left[0] -= 1
        return tasks.event("go") if left[0] else None

    factories = [FunctionEndpointFactory({GO: work}, "pilot", begin=lambda part: part.schedule(tasks.event("go")))]
    node = Node("test", Config(factories={"test": factories}), clock=SimClock())
    checks.append(Checks(node))
    node.begin()
    node.run_ready()
    assert not any("has not returned" in message for message in checks[0].reports)
    # but the place where the run spends its time is reported, once
    assert (
        sum(f"{SLOW_CHECKS} times in a row: the run spends its time there" in message for message in checks[0].reports)
        == 1
    )


def test_standstill_in_begin_loop_and_halt_is_reported() -> None:
    reports: dict[str, list[str]] = {}

    def stuck(step: str) -> Callable[[Any], None]:
        def hang(component: Any) -> None:
            checks = Checks(component.parent)
            checks.pass_by(2.5)
            reports[step] = checks.reports

        return hang

    beginner = FunctionEndpointFactory(name="beginner", begin=stuck("begin"), halt=stuck("halt"))
    TestRunner(
        Config(factories={"test": [beginner, FunctionLoopFactory(stuck("loop"), "ticker", 1.0)]}), until_s=0.5
    ).run()
    assert {step: len(message) for step, message in reports.items()} == {"begin": 1, "loop": 1, "halt": 1}
    assert "component 'ticker' has not returned" in reports["loop"][0]


def test_standstill_without_student_line_is_reported_later() -> None:
    node = Node("test", Config(factories={"test": [FunctionEndpointFactory(name="device")]}), clock=SimClock())
    checks = Checks(node)
    checks.watchdog._thread_id = 0  # not of a thread, so there is no frame
    node.machine.running = node.components["device"]
    checks.pass_by(9.0)
    assert checks.reports == []
    checks.pass_by(2.0)
    assert ["component 'device' has not returned for 10 s" in message for message in checks.reports] == [True]


def test_at_the_limit_the_run_is_ended_with_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted: list[str] = []
    monkeypatch.setattr(watchdog, "interrupt_main_thread", lambda: interrupted.append("pilot"))
    monkeypatch.setattr(
        LastResort, "_end_process", lambda self, reason, status: interrupted.append(f"{reason}, {status}")
    )
    with pytest.raises(ComponentFailedError) as caught:
        run_with(lambda checks: (checks.pass_by(7.0), tasks.event("go"))[1], limit_s=5.0)
    assert interrupted[0] == "pilot"
    assert "on_go() of component 'pilot'" in str(caught.value)
    assert "has not returned for 5 s at t = 0.000 s: the run was ended." in str(caught.value)


def test_without_a_limit_nothing_is_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watchdog, "interrupt_main_thread", lambda: pytest.fail("it was"))
    assert run_with(lambda checks: checks.pass_by(3600.0)).watchdog.failure is None


@pytest.mark.parametrize("limit_s", [0, -1.0, float("nan"), "60", True, None])
def test_invalid_stall_limit_raises_config_error(limit_s: Any) -> None:
    with pytest.raises(ConfigError, match="stall_limit_s"):
        Config(factories={"test": []}, stall_limit_s=limit_s)


class Steps:
    """A wall clock that a test moves."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def now_s(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        self.time_s = time_s


def overloaded(at_check: Callable[[Checks, Node, int], object], checks_s: float) -> list[str]:
    """Run a node whose one slow handler is looked at; before each look `at_check` is called with its number."""
    checks: list[Checks] = []
    numbers = iter(range(1000))

    def on_picture(task: Task, task_id: Any) -> Any:
        checks[0].pass_by(checks_s, lambda: at_check(checks[0], node, next(numbers)))
        return tasks.terminate("done")

    detector = FunctionEndpointFactory({(TaskType.event, "picture"): on_picture}, "detector")
    node = Node("robot", Config(factories={"robot": [detector]}), clock=Steps())
    checks.append(Checks(node))
    node.begin()
    node.enqueue_input(tasks.event("picture"), "camera_loop")
    node.run_ready()
    return checks[0].reports


def bring(count: int) -> Callable[[Checks, Node, int], object]:
    def at_check(checks: Checks, node: Node, number: int) -> None:
        node.machine.now_s += 0.1  # the handlers return, each after its time
        for _ in range(count):
            node.enqueue_input(tasks.event("picture"), "camera_loop")

    return at_check


@pytest.mark.parametrize(("inputs", "is_reported"), [(0, True), (10, True), (1000, False)])
def test_tasks_that_schedule_each_other_on_the_wall_clock_are_reported(inputs: int, is_reported: bool) -> None:
    def on_go(task: Task, task_id: Any) -> Task | None:
        (number,) = task.val_list
        if number % 500 == 0:
            node.enqueue_input([tasks.event("other")] * (inputs // 10), "sensor")
            checks.pass_by(0.5)
        return tasks.event("go", [number + 1]) if number < 5000 else None

    pilot = FunctionEndpointFactory({GO: on_go}, "pilot", begin=lambda part: part.schedule(tasks.event("go", [1])))
    node = Node("test", Config(factories={"test": [pilot]}))
    checks = Checks(node)
    node.begin()
    node.run_ready()
    reports = [one for one in checks.reports if "without end" in one]
    assert len(reports) == is_reported
    if is_reported:
        first, what, task, fix = reports[0].splitlines()
        assert "test_watchdog.py, line " in first
        assert "node 'test_node' has executed " in what
        assert what.endswith("came from outside: tasks schedule each other without end.")
        assert task.startswith("    event 'go' -> pilot.on_go (")
        assert fix.startswith("  Try: let a Loop bring in")


def test_overload_reports_tasks_senders_and_slow_handler() -> None:
    reports = overloaded(bring(1000), 1.5)
    (message,) = [one for one in reports if "tasks wait" in one]
    assert message.startswith("2000 tasks wait in node 'robot_node', the oldest for about 1.0 s: they come faster")
    assert "brought by camera_loop 100 %" in message
    assert "the node's time goes to detector.on_picture 100 % (tests/core/test_watchdog.py, line " in message
    assert "Try: a lower max_tick_rate_hz for what brings them" in message


def test_overload_is_reported_every_10_s() -> None:
    reports = overloaded(bring(1000), 30.0)
    assert len([one for one in reports if "tasks wait" in one]) == 3


def test_executed_burst_reports_no_overload() -> None:
    def burst(checks: Checks, node: Node, number: int) -> None:
        node.machine.now_s += 0.1
        if number % 2:
            node.inbox.waiting.clear()
        else:
            bring(5000)(checks, node, number)

    assert [one for one in overloaded(burst, 10.0) if "tasks wait" in one] == []


def test_overload_reports_task_kinds_and_sampled_senders() -> None:
    def accept_inputs(checks: Checks, node: Node, number: int) -> None:
        bring(3000)(checks, node, number)
        node.machine.accept_inputs()
        node.enqueue_input(tasks.event("sonar"), "link_tether")

    message = next(one for one in overloaded(accept_inputs, 1.5) if "tasks wait" in one)
    assert "most of them: event 'picture' 100 %" in message
    assert "brought by link_tether 100 %" in message
    assert SAMPLES > 1


def test_a_watched_run_has_no_thread_left_and_keeps_no_frame() -> None:
    import threading

    TestRunner(Config(factories={"test": [FunctionLoopFactory()]}), until_s=0.1).run()
    assert not [thread for thread in threading.enumerate() if thread.name == "watchdog"]


def hang(task: Task, task_id: Any) -> None:
    while True:
        time.sleep(0.01)


STUCK = {"a": [FunctionEndpointFactory({GO: hang}, "pilot", begin=lambda part: part.schedule(tasks.event("go")))]}


@pytest.mark.wall_clock
@pytest.mark.parametrize("runner", ["sim", "wall"])
def test_stalled_run_is_interrupted_at_its_limit(runner: str, capfd: pytest.CaptureFixture[str]) -> None:
    halted: list[str] = []
    motor = FunctionEndpointFactory(name="motor", halt=lambda part: halted.append("motor"))
    config = Config(factories={"a": [*STUCK["a"], motor]}, stall_limit_s=3.0)
    began_s = time.monotonic()
    with pytest.raises(
        ComponentFailedError, match="hang\\(\\) of component 'pilot', which handles event 'go', has not"
    ):
        (SimRunner(config) if runner == "sim" else SynchronousRunner("a", config)).run()
    assert halted == ["motor"]
    assert 3.0 <= time.monotonic() - began_s < 10.0
    message = capfd.readouterr().err
    assert message.count("nothing else runs meanwhile") == 1
    assert "the run was ended" not in message  # the exception says so, and no note as well


@pytest.mark.wall_clock
def test_repeatedly_sleeping_handler_is_reported_once_with_line(
    capfd: pytest.CaptureFixture[str],
) -> None:
    def doze(task: Task, task_id: Any) -> None:
        time.sleep(0.05)

    factories = [
        FunctionEndpointFactory({GO: doze}, "pilot"),
        FunctionLoopFactory(lambda loop: loop.schedule(tasks.event("go")), "t", 10),
    ]
    TestRunner(Config(factories={"test": factories}), until_s=13.0).run()
    message = capfd.readouterr().err
    assert message.count("doze() of component 'pilot' was in this line whenever the run was looked at") == 1
    assert ": time.sleep(0.05)" in message


CONTROLLERS = {"returns never": "pass", "swallows everything": "swallow()"}
CONTROLLER = """
import time
from snr_sim import Endpoint, EndpointFactory, TaskType

class PilotFactory(EndpointFactory):
    def get(self, parent):
        return Pilot(self, parent, "pilot")

class Pilot(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {{(TaskType.process_data, "radar"): self.on_radar}}

    def on_radar(self, task, task_id):
        while True:
            {body}

def swallow():
    try:
        time.sleep(0.01)
    except BaseException:
        pass

def factories(robot):
    return [PilotFactory()]
"""


@pytest.mark.wall_clock
@pytest.mark.parametrize("kind", CONTROLLERS)
def test_snr_run_ends_a_run_that_stands_still_and_names_the_line(kind: str, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(CONTROLLER.format(body=CONTROLLERS[kind]))
    command = [sys.executable, "-m", "snr_sim", "run", "lander_vertical", "--controller", "./mine.py"]
    ended = subprocess.run(
        [*command, "--json", "--stall-limit", "3"], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert ended.returncode == 1
    assert (
        "on_radar() of component 'pilot', which handles process_data 'radar', has not returned for 2 s" in ended.stderr
    )
    assert ended.stderr.startswith("mine.py, line ")
    if kind == "returns never":
        result = json.loads(ended.stdout)
        assert result["outcome"] == "error"
        assert "signal" not in result
        assert result["error"].count("the run was ended") == 1
        assert result["error"].startswith("mine.py, line 1")
        assert not any("the run was ended" in note for note in result["notes"])
    else:
        assert "After 2 s the process was ended." in ended.stderr


@pytest.mark.parametrize("error", [RuntimeError("can't start new thread"), SnrError("A graded program has one.")])
def test_run_continues_without_watchdog_thread(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(thread: threading.Thread) -> None:
        raise error

    monkeypatch.setattr(threading.Thread, "start", refuse)
    node = Node("test", Config(factories={"test": []}), clock=SimClock())
    with Watchdog([node]):
        node.begin()
    node.end()


def test_role_that_runs_on_after_another_has_ended_is_named_once() -> None:
    def begin(part: Any) -> None:
        part.schedule(tasks.terminate("done"))

    config = Config(factories={"pilot": [FunctionEndpointFactory({}, "end", begin=begin)], "robot": []})
    clock = SimClock()
    nodes = [Node(role, config, clock=clock) for role in config.factories]
    check = Unended(nodes)
    assert check.check(0.0) is None
    for node in nodes:
        node.begin()
        node.run_ready()
    assert [check.check(time_s) for time_s in (100.0, 100.0 + UNENDED_AFTER_S - 0.1)] == [None, None]
    report = check.check(100.0 + UNENDED_AFTER_S)
    assert report is not None
    assert "Role 'pilot' has ended, and 'robot' still runs, now at t = 0 s" in report
    assert "until_s" in report
    assert check.check(1000.0) is None
    nodes[1].set_terminate_flag("done")
    nodes[1].run_ready()
    assert Unended(nodes).check(2000.0) is None


@pytest.mark.parametrize(
    ("limits", "is_endless"), [({}, True), ({"until_s": 1.0}, False), ({"pace": 1000.0}, False)], ids=str
)
def test_only_a_run_without_time_limit_is_checked_for_its_end(
    limits: dict[str, float], is_endless: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = []

    def make(nodes: Any, *, is_endless: bool) -> Watchdog:
        given.append(is_endless)
        return Watchdog(nodes, is_endless=is_endless)

    monkeypatch.setattr(lockstep, "Watchdog", make)
    SimRunner(Config(factories={"a": [], "b": []}), **limits).run()
    assert given == [is_endless]
