"""Roles in processes: one that fails ends the others in order, Ctrl-C ends all, and nothing is ever left behind."""

import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, MultiProcRunner, TaskType, TimeoutLoopFactory
from snr_sim.prelude.errors import ConfigError, UnknownNameError
from snr_sim.testing.function_components import FunctionEndpointFactory

HERE = Path(__file__).parent
LIMIT_S = 60.0  # for what takes a second on a machine that has nothing else to do


class Program:
    """`supervised.py`, running in a group of its own, as a terminal starts programs."""

    def __init__(self, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(HERE / "supervised.py"), *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            process_group=0,
            env={**os.environ, "PYTHONPATH": str(HERE.parents[1])},
        )
        self.out, self.err = "", ""
        self._has_more = threading.Condition()
        self._readers = [threading.Thread(target=self._read, args=(name,), daemon=True) for name in ("out", "err")]
        for reader in self._readers:
            reader.start()

    def _read(self, name: str) -> None:
        with getattr(self.process, f"std{name}") as stream:
            for line in stream:
                with self._has_more:
                    setattr(self, name, getattr(self, name) + line)
                    self._has_more.notify_all()

    def wait_for(self, text: str, count: int = 1) -> None:
        """Returns when a text has come so often."""
        with self._has_more:
            assert self._has_more.wait_for(lambda: self.out.count(text) >= count, LIMIT_S), self.out

    def signal(self, number: int) -> None:
        """Send a signal to the process group, as a terminal does at Ctrl-C."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, number)

    def finish(self) -> tuple[int, str]:
        """Returns exit status and stderr; everything it had started must be gone."""
        try:
            self.process.wait(LIMIT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            pytest.fail(f"it hung: {self.out}")
        for reader in self._readers:
            reader.join(LIMIT_S)
        for pid in map(int, re.findall(r"begun (\d+)", self.out)):
            assert not is_alive(pid)
        return self.process.returncode, self.err


def is_alive(pid: int) -> bool:
    """Whether it runs; who has ended, and only its new parent has not yet looked, does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def run(*words: str) -> tuple[int, str, str]:
    program = Program(*words)
    status, err = program.finish()
    return status, program.out, err


def assert_all_halted(out: str) -> None:
    """What has begun, and what was interrupted just then, has been halted."""
    for name in ("a", "b"):
        assert out.count(f"[{name}] begun") <= out.count(f"[{name}] halted"), out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (
            "fail",
            [
                "supervised.py, line ",
                ': raise ValueError("no echo")\n  ValueError: no echo\n',
                "in begin() of component 'b_part'",
                "in role",
            ],
        ),
        ("leave", ["SystemExit: 3", "component 'b_part'"]),
        ("leave_at_once", ["The process of role 'b' ended with exit status 3. Its last lines:", "    bus voltage 9.1"]),
        ("kill", ["The process of role 'b' was ended by SIGKILL. Its last lines:", "    the last words"]),
    ],
)
def test_weakness_21_failed_role_is_reported_and_ends_others_with_status_1(kind: str, expected: list[str]) -> None:
    status, out, err = run(kind)
    assert status == 1
    for words in expected:
        assert words in err
    assert out.count("[a] begun") == out.count("[a] halted")
    assert out.endswith("over\n")


@pytest.mark.slow
def test_output_of_role_is_forwarded_by_line_with_name() -> None:
    status, out, err = run("print_lines", "ends_all")
    assert status == 0
    assert "[b] one line\n" in out
    assert "[b] another one\n" in out
    assert "[b] a complaint\n" in err
    assert_all_halted(out)


@pytest.mark.slow
def test_ended_role_ends_others_only_with_ends_all() -> None:
    assert run("end", "ends_all")[0] == 0
    program = Program("end")
    program.wait_for("[b] halted")
    program.wait_for("[a] begun")
    assert program.process.poll() is None
    program.signal(signal.SIGTERM)
    assert program.finish()[0] == 0
    assert_all_halted(program.out)


@pytest.mark.wall_clock
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_weakness_22_one_signal_ends_every_role_in_order_and_loops_in_processes_too(number: int) -> None:
    program = Program("nothing", "heavy")
    program.wait_for("begun", 3)
    program.signal(number)
    status, err = program.finish()
    assert (status, err) == (0, "")
    assert program.out.count("halted") == 3


@pytest.mark.wall_clock
def test_a_role_that_does_not_return_is_interrupted_a_moment_later_and_all_is_halted() -> None:
    program = Program("doze")
    program.wait_for("begun", 2)
    program.signal(signal.SIGINT)
    status, err = program.finish()
    assert status == 0
    assert "[b] note: SIGTERM: component 'b_part' did not return, and was interrupted." in err
    assert_all_halted(program.out)


@pytest.mark.wall_clock
def test_a_second_signal_does_not_wait_for_what_cannot_be_interrupted() -> None:
    program = Program("stubborn")
    program.wait_for("begun", 2)
    program.wait_for("stuck")
    program.signal(signal.SIGINT)
    program.signal(signal.SIGTERM)
    status, err = program.finish()
    assert status == 1
    assert "The process of role 'b' did not end when it was asked, and was killed." in err
    assert "[a] halted" in program.out


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_random_signals_halt_all_and_leave_no_process(seed: int) -> None:
    chance = random.Random(seed)
    program = Program(chance.choice(["nothing", "doze", "end"]), *chance.choice([[], ["heavy"]]))
    begun = chance.choice([0, 1, 2])
    if begun:
        program.wait_for("begun", begun)
    else:
        wait_until_it_listens(program.process.pid)
    threading.Event().wait(chance.choice([0.0, chance.uniform(0.0, 0.2)]))
    program.signal(chance.choice([signal.SIGINT, signal.SIGTERM]))
    status, err = program.finish()
    assert status == 0, err
    assert_all_halted(program.out)


def wait_until_it_listens(pid: int) -> None:
    """Before a program has taken over, Ctrl-C ends it as it ends any Python."""
    deadline_s = time.monotonic() + LIMIT_S
    mask = 1 << (signal.SIGTERM - 1)
    while time.monotonic() < deadline_s:
        caught = re.search(r"SigCgt:\s*(\w+)", Path(f"/proc/{pid}/status").read_text())
        if caught and int(caught[1], 16) & mask:
            return
        time.sleep(0.005)
    pytest.fail("it never listened")


@pytest.mark.slow
def test_when_the_program_itself_is_killed_every_role_and_their_loops_end_too() -> None:
    program = Program("nothing", "heavy")
    program.wait_for("begun", 3)
    program.process.kill()
    program.process.wait()
    pids = [int(pid) for pid in re.findall(r"begun (\d+)", program.out)]
    deadline_s = time.monotonic() + LIMIT_S
    while any(map(is_alive, pids)) and time.monotonic() < deadline_s:
        time.sleep(0.01)
    assert not any(map(is_alive, pids))
    program.finish()


@pytest.mark.slow
def test_leftover_child_of_role_does_not_delay_end() -> None:
    start_s = time.monotonic()
    assert run("leave_child", "ends_all")[0] == 0
    assert time.monotonic() - start_s < 35.0  # a process that is left sleeps for 40 s


def test_unpicklable_factory_raises_before_any_process_starts() -> None:
    locked = FunctionEndpointFactory({TaskType.event: threading.Lock()})  # type: ignore[dict-item]
    with pytest.raises(ConfigError) as caught:
        MultiProcRunner(Config(factories={"a": [FunctionEndpointFactory(name="x")], "b": [locked]})).run()
    assert "Role 'b' runs in a process of its own, and FunctionEndpointFactory's attribute `handlers[" in str(
        caught.value
    )
    assert "]` cannot be sent there: lock (" in str(caught.value)
    assert "setup()" in str(caught.value)


@pytest.mark.parametrize("arguments", [{"roles": ["a", "c"]}, {"ends_all": ["c"]}])
def test_a_role_that_is_unknown_is_named_with_those_there_are(arguments: dict[str, Any]) -> None:
    with pytest.raises(UnknownNameError, match="no role 'c'"):
        MultiProcRunner(Config(factories={"a": [], "b": []}), **arguments)
    with pytest.raises(ConfigError, match="named twice: a, a"):
        MultiProcRunner(Config(factories={"a": []}), ["a", "a"])


def test_a_runner_runs_once_as_a_node_does() -> None:
    runner = MultiProcRunner(Config(factories={"a": []}), [])
    runner.run()
    with pytest.raises(ConfigError, match="has already run"):
        runner.run()


@pytest.mark.slow
def test_roles_run_from_another_thread_than_the_main_one_too() -> None:
    config = Config(factories={"a": [TimeoutLoopFactory(seconds=0.01)], "b": [TimeoutLoopFactory(seconds=0.01)]})
    errors: list[BaseException] = []

    def run_all() -> None:
        try:
            MultiProcRunner(config, ["a", "b"]).run()
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=run_all)
    thread.start()
    thread.join(LIMIT_S)
    assert not thread.is_alive()
    assert errors == []
