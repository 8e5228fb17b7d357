"""What a submission may do wrong: each ends as a failed case with a hint, and the student's own line first."""

from collections.abc import Callable
from pathlib import Path

import pytest

from snr_sim.grading import Stimulus, Student
from snr_sim.grading.lab.lab import find_lab
from snr_sim.grading.lab.verdicts import SubmissionError
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.sandbox.sandbox import Limits

Copying = Callable[..., ForkServer]

CONTROLLER = """
from snr_sim import Endpoint, EndpointFactory, Loop, LoopFactory, Task, TaskType, tasks
from snr_sim.prelude.task import Page

def factories(robot):
    return [MineFactory()]

class MineFactory(EndpointFactory):
    def get(self, parent):
        return Mine(self, parent, "mine")

class Mine(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar, (TaskType.event, "again"): self.on_radar}

    def on_radar(self, task, task_id):
        BODY
"""


CATCHES_ALL = """
def f(x):
    while True:
        try:
            while True:
                pass
        except BaseException:
            pass
"""
IGNORES_SIGNALS = """
import signal

def f(x):
    signal.signal(signal.SIGPROF, signal.SIG_IGN)
    while True:
        pass
"""


def error_of_call(folder: Path, source: str, copying: Copying | None = None, **limits: int) -> SubmissionError:
    """How a call of `f` in this program ends."""
    (folder / "mine.py").write_text(source)
    fork_server = copying and copying(**limits)
    with (
        Student(folder, limits=Limits(**limits), fork_server=fork_server) as student,
        pytest.raises(SubmissionError) as caught,
    ):
        student.call("mine.py", "f", 1.0, returns=float, budget_s=0.3)
    return caught.value


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "first_line", "hint"),
    [
        ("def f(x)\n    return x", "mine.py, line 1: def f(x)", "read"),
        ("", "mine.py has no function `f`.", "compare it with the lab's page"),
        ("f = 3", "mine.py: `f` is 3, not a function.", "compare it with the lab's page"),
        ("def g(x):\n    return x", "mine.py has no function `f`.", "compare it with the lab's page"),
        ("import nowhere", "mine.py, line 1: import nowhere", "read"),
        ("def f():\n    return 1.0", "mine.py, line 1: def f():", "look at the line named"),
        ("def f(x):\n    return x / 0", "mine.py, line 2: return x / 0", "look at the line named"),
        ("def f(x):\n    raise SystemExit(0)", "mine.py, line 2: raise SystemExit(0)", "look at the line named"),
        ("def f(x):\n    raise ValueError('\\udc00')", "mine.py, line 2: raise ValueError", "look at the line named"),
        ("exit(0)", "mine.py, line 1: exit(0)", "read"),
        ("import os\ndef f(x):\n    os._exit(0)", "It ended with exit status 0 instead of answering.", "no exit()"),
        ("def f(x):\n    return 'three'", "mine.py: f(...) returned 'three'.", "a number"),
        ("def f(x):\n    return None", "mine.py: f(...) returned None.", "a number"),
        ("def f(x):\n    return [x]", "mine.py: f(...) returned [1.0].", "a number"),
        ("def f(x):\n    return float('nan')", "mine.py: f(...) returned nan among its numbers.", "finite"),
        ("def f(x):\n    return object()", "mine.py, line 1: def f(x):", "Return numbers"),
        ("def f(x):\n    return {1: 2}", "mine.py, line 1: def f(x):", "Return numbers"),
        ("def f(x):\n    y = []\n    y.append(y)\n    return y", "mine.py, line 1: def f(x):", "Return numbers"),
        ("def f(x):\n    while True:\n        pass", "mine.py, line ", "loop without an end"),
        ("while True:\n    pass", "mine.py, line ", "loop without an end"),
        (CATCHES_ALL, "It used up its CPU time", "loop without an end"),
        (IGNORES_SIGNALS, "It used up its CPU time", "loop without an end"),
        ("def f(x):\n    return 'y' * 2_000_000", "It answered with more than 1048576 bytes.", "no more"),
        (
            "def f(x):\n    while True:\n        print('hello' * 1000)",
            "It printed more than a megabyte",
            "Take out the print",
        ),
        ("import socket", "mine.py, line 1: imports socket, but there is no network", "Do without importing socket"),
        ("import package", "package/inner.py, line 1: imports ctypes", "Do without importing ctypes"),
        (f"import {'m' * 300}", "mine.py, line 1: import mmm", "could not be read to its end"),
        ("import beside", "beside.py, line 1: imports subprocess, but", "Do without importing subprocess"),
        ("import threading\ndef f(x):\n    threading.Thread().start()", "mine.py, line 3: ", "look at the line named"),
        (
            "import signal\ndef f(x):\n    signal.sigwait([1])",
            "It has not answered, and was ended.",
            "waits for something",
        ),
        ("x" * 2_000_000, "mine.py has more than 1048576 bytes.", "program alone"),
    ],
)
def test_function_error_starts_with_the_student_line(
    source: str, first_line: str, hint: str, copying: Copying, tmp_path: Path
) -> None:
    (tmp_path / "beside.py").write_text("import subprocess")
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "inner.py").write_text("import ctypes")
    wrong = error_of_call(tmp_path, source, copying)
    assert wrong.message.startswith(first_line)
    assert hint in wrong.hint


@pytest.mark.slow
@pytest.mark.parametrize("source", ["exit(0)", "def f(x):\n    quit()"])
def test_exit_in_a_checked_file_says_to_leave_it_out(source: str, copying: Copying, tmp_path: Path) -> None:
    wrong = error_of_call(tmp_path, source, copying)
    assert (
        "Try: leave it out: a file ends by itself, and a component ends the run with tasks.terminate" in wrong.message
    )


def test_missing_file_or_outside_link_raises(tmp_path: Path) -> None:
    (tmp_path / "submission").mkdir()
    (tmp_path / "secret.py").write_text("def f(x):\n    return x")
    student = Student(tmp_path / "submission")
    with pytest.raises(SubmissionError, match=r"There is no file mine\.py"):
        student.call("mine.py", "f")
    (tmp_path / "submission" / "mine.py").symlink_to(tmp_path / "secret.py")
    with pytest.raises(SubmissionError, match=r"mine\.py is a link to elsewhere"):
        student.source("mine.py")


@pytest.mark.slow
def test_memory_limit_raises_memory_error_in_the_student_line(tmp_path: Path) -> None:
    wrong = error_of_call(tmp_path, "def f(x):\n    y = [0] * 10**9\n    return x", memory_bytes=1 << 29)
    assert wrong.message.startswith("mine.py, line 2: y = [0] * 10**9\n  MemoryError")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "message"),
    [
        (
            "return 1 / 0",
            "line 18: return 1 / 0\n  ZeroDivisionError: division by zero\n  in on_radar(), component 'mine'",
        ),
        ("return 'go'", "'mine.on_radar' returned 'go', which is not a task."),
        (
            "return self.store_data_task('radar', 1)",
            "'mine' stored the page 'radar', which it is not allowed to store.",
        ),
        ("return tasks.event('again')", "scheduled more than 10000 tasks at one moment"),
        ("return [tasks.event('x')] * 20_000", "scheduled more than 10000 tasks at one moment"),
        ("return tasks.reload_component('radar_sensor')", "requested a change of components"),
        ("return tasks.remove_component('radar_sensor')", "requested a change of components"),
        ("return Task(TaskType.event, 'finish_node', ['x', 10**9])", "made a task 'finish_node' by itself"),
        ("return Task(TaskType.store_page, 'a', [Page('a', 1, 'me', 1e9)])", "which is in the future"),
        ("return Task(TaskType.store_page, 'a', [1])", "does not carry exactly this page"),
        ("return self.store_data_task('engine', object())", "a value that cannot leave its process"),
        ("return self.store_data_task('engine', {'throttle': float('nan')})", "throttle"),
        ("return self.store_data_task('engine', {'throttle': 'full'})", "throttle"),
        ("while True: pass", "takes too long"),
        ("raise SystemExit", "line 18: raise SystemExit"),
        ("import os; os._exit(0)", "It ended with exit status 0 instead of answering."),
    ],
)
def test_component_error_ends_the_run_with_its_message(
    body: str, message: str, copying: Copying, tmp_path: Path
) -> None:
    (tmp_path / "mine.py").write_text(CONTROLLER.replace("BODY", body))
    student = Student(tmp_path, limits=Limits(cpu_s=2), fork_server=copying(cpu_s=2))
    with pytest.raises(SubmissionError) as caught:
        student.run_scenario("lander_vertical", 3, "mine.py")
    assert message in caught.value.message
    assert caught.value.hint


@pytest.mark.slow
@pytest.mark.parametrize("ends", ["tasks.terminate('won')", "tasks.finish('won')"])
def test_run_ended_early_by_the_program_raises(ends: str, copying: Copying, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(CONTROLLER.replace("BODY", f"return {ends}"))
    student = Student(tmp_path, fork_server=copying())
    with pytest.raises(SubmissionError, match=r"Your program ended the run at 0\.\d\d s") as flying:
        student.run_scenario("lander_vertical", 3, "mine.py")
    pages = [Stimulus(0.1 * i, "radar", {"altitude_m": 1.0}) for i in range(5)]
    with pytest.raises(SubmissionError, match=r"Your program ended the run at 0\.00 s") as fed:
        student.run_inputs("mine.py", pages, robot="lander")
    assert "tasks.terminate or tasks.finish" in flying.value.hint
    assert fed.value.hint == flying.value.hint
    assert [one.kind for one in student.run_inputs("mine.py", pages[:1], robot="lander")] != [], (
        "nothing was left to come"
    )
    assert student.run_scenario("lander_vertical", 3, "mine.py", may_fail=True).outcome == "ended"


@pytest.mark.slow
def test_response_forged_before_its_request_is_rejected(tmp_path: Path) -> None:
    """It is on the line before the kit's own, with the right number and another value."""
    forged = "import os, stat\nfor fd in range(3, 2000):\n    try:\n        if stat.S_ISSOCK(os.fstat(fd).st_mode):\n"
    forged += '            os.write(fd, b\'{"n":3,"value":null}\\n\')\n    except OSError: pass\n'
    (tmp_path / "mine.py").write_text(forged + "class TaskQueue: pass\n")
    with (
        Student(tmp_path) as student,
        pytest.raises(SubmissionError, match="The submission broke the grading protocol: its answer is not valid"),
    ):
        student.create_object("mine.py", find_lab("write_the_queue").module("grader.queue_bench").QueueBench)


@pytest.mark.slow
def test_malformed_response_raises_even_with_may_fail(tmp_path: Path) -> None:
    body = "import sys; sys.modules['snr_sim.grading.remote.child_node']._encode = lambda answer: b'5'"
    (tmp_path / "mine.py").write_text(CONTROLLER.replace("BODY", body))
    with pytest.raises(SubmissionError, match="its answer is not valid: Expected `object`, got `int`") as caught:
        Student(tmp_path).run_scenario("lander_vertical", 3, "mine.py", may_fail=True)
    assert caught.value.hint == "Do not use file descriptors that your program has not opened."


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("", "mine.py has no function `factories`"),
        (
            "def factories(robot):\n    return 3",
            "mine.py, line 1: def factories(robot):\n  factories(robot) returned 3, which is not a list.",
        ),
        ("def factories(robot):\n    return [3]", "returned a list with 3, which is not a factory."),
        ("def factories():\n    return []", "factories() is called with 1 argument(s)"),
        (CONTROLLER.replace("def get", "def got"), "MineFactory needs a method get"),
        (CONTROLLER + "\nROLES = ('captain',)", "the robot has no role 'captain'"),
        (CONTROLLER + "\nROLES = 3", "ROLES is 3, not a tuple of roles"),
        (CONTROLLER + "\nOPTIONS = 3", "OPTIONS is 3, not a dict"),
    ],
)
def test_invalid_controller_raises_with_its_reason(source: str, message: str, copying: Copying, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(source.replace("BODY", "return None"))
    with pytest.raises(SubmissionError) as caught:
        Student(tmp_path, fork_server=copying()).run_scenario("lander_vertical", 3, "mine.py")
    assert message in caught.value.message
    assert ", line " in caught.value.message or "line named" not in caught.value.hint


@pytest.mark.slow
def test_component_error_in_a_bare_node_raises_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(CONTROLLER.replace("BODY", "return self.get_data('radar')['altitude']"))
    with pytest.raises(SubmissionError) as caught:
        Student(tmp_path).run_inputs("mine.py", [Stimulus(0.0, "radar", {"altitude_m": 1.0})], robot="lander")
    assert caught.value.message.startswith("mine.py, line 18: return self.get_data('radar')['altitude']\n  KeyError")
