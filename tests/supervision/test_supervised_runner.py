"""Roles under a supervisor: what is killed, stopped or hangs is started again, and too many failures end all."""

import os
import re
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from snr_sim import Config, PipesPair
from snr_sim.prelude.errors import ConfigError, UnknownNameError
from snr_sim.supervision import Child, SupervisedRunner, Supervisor
from snr_sim.supervision.health import read_health
from snr_sim.testing.function_components import FunctionEndpointFactory
from tests.slowness import slowness
from tests.supervision.test_multi_proc import LIMIT_S, Program, is_alive, run


def hang_s() -> str:
    """The timeout of a hang: an idle process reports five times in it."""
    return f"{2.0 * slowness():.1f}"


def pids(program: Program, role: str) -> list[int]:
    return [int(pid) for pid in re.findall(rf"\[{role}\] begun (\d+)", program.out)]


def wait_until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < deadline_s
        threading.Event().wait(0.05)


@pytest.mark.slow
def test_killed_role_is_started_again_alone(tmp_path: Path) -> None:
    program = Program("nothing", "supervised", "3", "60", str(tmp_path))
    program.wait_for("begun", 2)
    (a,), (b,) = pids(program, "a"), pids(program, "b")
    os.kill(b, signal.SIGKILL)
    program.wait_for("[b] begun", 2)
    assert pids(program, "a") == [a]
    assert is_alive(a)
    program.signal(signal.SIGTERM)
    status, err = program.finish()
    assert status == 0
    assert "root/b is restarting: The process of role 'b' was ended by SIGKILL." in err
    assert program.out.count("[a] halted") == program.out.count("[b] halted") == 1
    assert [(part.state, part.restarts) for part in read_health(tmp_path).tree] == [
        ("ended", 0),
        ("ended", 0),
        ("ended", 1),
    ]


@pytest.mark.slow
def test_restarted_role_listens_at_the_same_port_and_is_connected_again(tmp_path: Path) -> None:
    program = Program("send_pid", "linked", "supervised", "3", "60", str(tmp_path))
    program.wait_for("[a] received ")
    (b,) = pids(program, "b")
    assert f"[a] received {b}\n" in program.out
    os.kill(b, signal.SIGKILL)
    program.wait_for("[a] received ", 2)
    again = pids(program, "b")[-1]
    assert again != b
    assert f"[a] received {again}\n" in program.out
    program.signal(signal.SIGTERM)
    assert program.finish()[0] == 0


@pytest.mark.wall_clock
@pytest.mark.parametrize("kind", ["SIGSTOP", "hang_later"])
def test_silent_role_is_ended_or_killed_and_started_again(kind: str, tmp_path: Path) -> None:
    program = Program("nothing" if kind == "SIGSTOP" else kind, "supervised", "9", hang_s(), str(tmp_path))
    program.wait_for("begun", 2)
    (b,) = pids(program, "b")
    if kind == "SIGSTOP":
        wait_until(lambda: not read_health(tmp_path).is_degraded)  # a report shows that it has begun
        os.kill(b, signal.SIGSTOP)
    program.wait_for("[b] begun", 2)
    assert not is_alive(b)
    program.signal(signal.SIGTERM)
    status, err = program.finish()
    assert status == 0
    assert "root/b is hung: it hung: no report for " in err
    assert len(pids(program, "a")) == 1


@pytest.mark.wall_clock
def test_silence_while_the_supervisor_itself_is_stopped_is_not_a_hang(tmp_path: Path) -> None:
    program = Program("nothing", "supervised", "0", hang_s(), str(tmp_path))
    program.wait_for("begun", 2)
    wait_until(lambda: not read_health(tmp_path).is_degraded)
    os.kill(program.process.pid, signal.SIGSTOP)
    threading.Event().wait(1.5 * float(hang_s()))
    os.kill(program.process.pid, signal.SIGCONT)
    wait_until(lambda: "note: the supervisor did not run for " in program.err)
    program.signal(signal.SIGTERM)
    status, err = program.finish()
    assert status == 0
    assert "hung" not in err
    assert (len(pids(program, "a")), len(pids(program, "b"))) == (1, 1)


@pytest.mark.slow
def test_too_many_failures_are_a_safe_stop_with_status_1_and_all_reasons(tmp_path: Path) -> None:
    status, out, err = run("leave_at_once", "supervised", "2", "60", str(tmp_path))
    assert status == 1
    assert out.count("[b] begun") == 3
    reason = r"b failed 3 times in \d+ s \(2 restarts are allowed in 600 s\), last: The process of role 'b' ended with "
    assert re.search(f"safe stop: {reason}exit status 3", err)
    assert re.search(f"SupervisionError: {reason}exit status 3", err)
    assert "All processes were ended" in err
    assert "Last lines of role 'b':\n    bus voltage 9.1 V" in err
    assert out.count("[a] begun") == out.count("[a] halted") == 1
    health = read_health(tmp_path)
    assert health.is_safe_stop
    assert [(part.name, part.state, part.restarts) for part in health.tree][1:] == [
        ("a", "ended", 0),
        ("b", "failed", 2),
    ]
    assert health.tree[2].last_lines == ["bus voltage 9.1 V"]


@pytest.mark.slow
def test_reported_error_of_a_role_is_its_reason(tmp_path: Path) -> None:
    status, _, err = run("fail", "supervised", "0", "60", str(tmp_path))
    assert status == 1
    assert "b failed once (0 restarts are allowed in 600 s), last: " in err
    assert "ValueError: no echo" in err
    assert "ValueError: no echo" in read_health(tmp_path).tree[2].why


@pytest.mark.slow
def test_role_that_ends_by_itself_is_not_started_again_on_failure_only(tmp_path: Path) -> None:
    program = Program("end", "supervised", "0", "60", str(tmp_path))
    program.wait_for("[b] halted")
    program.wait_for("[a] begun")
    program.signal(signal.SIGINT)
    assert program.finish()[0] == 0
    assert len(pids(program, "b")) == 1


@pytest.mark.slow
def test_killed_supervisor_leaves_no_process(tmp_path: Path) -> None:
    program = Program("nothing", "heavy", "supervised", "3", "60", str(tmp_path))
    program.wait_for("begun", 3)
    program.process.kill()
    wait_until(lambda: not any(is_alive(pid) for pid in [*pids(program, "a"), *pids(program, "b")]))
    program.finish()


def test_child_that_is_not_a_role_raises_with_the_known_roles() -> None:
    config = Config(factories={"drive": [], "gps": []})
    with pytest.raises(UnknownNameError, match="no role 'gsp'"):
        SupervisedRunner(config, Supervisor("root", [Child("drive"), Child("gsp")]))


def test_role_for_the_health_page_that_is_not_supervised_raises_unknown_name_error() -> None:
    with pytest.raises(UnknownNameError, match="'gsp' is not supervised"):
        SupervisedRunner(Config(factories={"drive": [], "gps": []}), health_to="gsp")


def test_role_with_a_pipe_is_rejected_because_it_cannot_be_opened_again() -> None:
    pair = PipesPair()
    with pytest.raises(ConfigError, match="Role 'b' has a link over a pipe"):
        SupervisedRunner(Config(factories={"a": [], "b": [pair.client("depth")]}))


def test_unpicklable_factory_raises_before_any_process_starts() -> None:
    locked = FunctionEndpointFactory({"go": threading.Lock()})  # type: ignore[dict-item]
    runner = SupervisedRunner(Config(factories={"a": [], "b": [locked]}))
    with pytest.raises(ConfigError, match="Role 'b' runs in a process of its own"):
        runner.run()
    with pytest.raises(ConfigError, match="has already run"):
        runner.run()
