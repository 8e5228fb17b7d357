"""A student's process: which failures are the student's, and which are the grader's."""

import socket
import time
from pathlib import Path

import pytest

from snr_sim.grading import Student
from snr_sim.grading.lab.verdicts import GraderError, SubmissionError
from snr_sim.grading.remote import launch
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.remote.protocol import Hello
from snr_sim.grading.remote.student_process import StudentProcess
from snr_sim.grading.sandbox.sandbox import Limits


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["raise MemoryError('no room for numpy')", "import os; os._exit(3)", "print('hm')"])
def test_process_that_ends_before_loading_raises_grader_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    start = launch.start_command

    def broken(*args: object) -> tuple[list[str], Path]:
        command, folder = start(*args)  # type: ignore[arg-type]
        return [*command[:-1], ending], folder

    monkeypatch.setattr(launch, "start_command", broken)
    child = StudentProcess(tmp_path, "none", Limits())
    with pytest.raises(GraderError, match="could not be started"):
        child.ask(Hello(), 1.0)
    child.close()


def test_failed_start_closes_both_sockets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*args: object) -> tuple[list[str], Path]:
        raise OSError(24, "Too many open files")

    line = socket.socketpair()
    monkeypatch.setattr(launch, "start_command", fails)
    monkeypatch.setattr("socket.socketpair", lambda: line)
    with pytest.raises(OSError, match="Too many"):
        StudentProcess(tmp_path, "none", Limits())
    assert [end.fileno() for end in line] == [-1, -1]


def is_running(number: int) -> bool:
    """Return whether there is a process of this number, and not only what is left of one."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.slow
def test_copies_without_isolation_are_as_fresh_processes(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "import os, time\n"
        "asked = []\n"
        "def ask():\n    asked.append(1)\n    return [len(asked), os.getcwd(), os.getpid() == os.getsid(0)]\n"
        "def orphan():\n    pid = os.fork()\n    if pid:\n        return pid\n    while True:\n        pass\n"
        "def leave():\n    os._exit(7)\n"
    )
    with ForkServer("none", Limits()) as fork_server:
        with Student(tmp_path, fork_server=fork_server) as one, Student(tmp_path, fork_server=fork_server) as other:
            assert one.call("mine.py", "ask") == other.call("mine.py", "ask") == [1, str(tmp_path), True]
            orphan = one.call("mine.py", "orphan")
            with pytest.raises(SubmissionError, match="exit status 7"):
                other.call("mine.py", "leave")
            assert one.call("mine.py", "ask")[0] == 2
        gives_up_s = time.monotonic() + 60.0
        while is_running(orphan) and time.monotonic() < gives_up_s:
            time.sleep(0.01)
        assert not is_running(orphan)
        assert fork_server.fork(tmp_path, "sandbox", 0, ()) is None  # or a program would run without its sandbox


def test_fork_server_makes_no_copies_where_the_kernel_has_no_handles(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(number: int) -> int:
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr("os.pidfd_open", missing)
    with ForkServer("none", Limits()) as fork_server:
        assert fork_server.fork(Path("/"), "none", 0, ()) is None
