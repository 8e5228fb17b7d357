"""A student's process: which failures are the student's, and which are the grader's."""

import socket
from pathlib import Path

import pytest

from snr_sim.grading.lab.verdicts import GraderError
from snr_sim.grading.remote import launch
from snr_sim.grading.remote.child_process import ChildProcess
from snr_sim.grading.remote.protocol import Hello
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
    child = ChildProcess(tmp_path, "none", Limits())
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
        ChildProcess(tmp_path, "none", Limits())
    assert [end.fileno() for end in line] == [-1, -1]
