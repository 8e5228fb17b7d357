"""Cases of several submissions in one sandbox: none finds traces of another, and no submission can break it."""

import os
import select
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from snr_sim.grading import Student
from snr_sim.grading.lab.verdicts import GraderError, SubmissionError
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.sandbox.sandbox import Limits, is_root
from tests.grading.probe import GUARD

PROGRAM = (
    GUARD
    + '''
import sys

kept = []


def traces():
    """Return what differs between cases."""
    libc = __import__("ctypes").CDLL(None)
    kept.append(1)
    return {
        "kept": len(kept),
        "scratch": os.listdir("/tmp"),
        "segment": libc.shmget(4711, 4096, 0),
        "number": [os.getpid(), os.getppid(), os.getsid(0), os.getpgrp()],
        "modules": sorted(sys.modules),
        "folder": os.getcwd(),
        "files": sorted(os.listdir()),
    }


def leave(what):
    libc = __import__("ctypes").CDLL(None)
    if what == "file":
        open("/tmp/left", "w").close()
    elif what == "trace of a file":
        open("/tmp/left", "w").close()
        os.remove("/tmp/left")
    elif what == "segment":
        assert libc.shmget(4711, 4096, 0o1666) >= 0
    elif what == "module":
        sys.modules["snr_sim.grading.sandbox.seccomp"] = sys


def kill():
    killed = []
    for number in (-1, 1, 2, 3, 4, os.getppid()):
        try:
            os.kill(number, 9)
            killed.append(number)
        except OSError:
            continue
    return killed


def end(how):
    if how == "exit":
        os._exit(7)
    if how == "abort":
        os.abort()
    os.kill(os.getpid(), how)
    return "alive"
'''
)

pytestmark = pytest.mark.usefixtures("sandbox")


@pytest.fixture
def fork_server(tmp_path: Path) -> Iterator[ForkServer]:
    if not is_root():
        pytest.skip("there are copies for root alone")
    (tmp_path / "mine.py").write_text(PROGRAM)
    tmp_path.chmod(0o755)
    with ForkServer("sandbox", Limits()) as fork_server, fork_server.with_submission(tmp_path):
        yield fork_server


def new_case(fork_server: ForkServer, folder: Path, function: str, *args: Any) -> Any:
    """Return the answer of a new case."""
    with Student(folder, "sandbox", fork_server=fork_server) as student:
        return student.call("mine.py", function, *args)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["nothing", "file", "trace of a file", "segment", "module"])
def test_case_finds_no_traces_of_the_previous_case(
    what: str, namespaces_alone: None, fork_server: ForkServer, tmp_path: Path
) -> None:
    first = new_case(fork_server, tmp_path, "traces")
    new_case(fork_server, tmp_path, "leave", what)
    assert new_case(fork_server, tmp_path, "traces") == first
    assert (first["kept"], first["segment"]) == (1, -1)


@pytest.mark.slow
def test_sandbox_is_replaced_after_a_write(fork_server: ForkServer, tmp_path: Path) -> None:
    def sandbox() -> Any:
        assert fork_server._process is not None
        return fork_server._process.pid

    new_case(fork_server, tmp_path, "traces")
    first = sandbox()
    new_case(fork_server, tmp_path, "traces")
    assert sandbox() == first
    new_case(fork_server, tmp_path, "leave", "file")
    new_case(fork_server, tmp_path, "traces")
    assert sandbox() != first


@pytest.mark.slow
def test_case_cannot_kill_the_fork_server(namespaces_alone: None, fork_server: ForkServer, tmp_path: Path) -> None:
    assert new_case(fork_server, tmp_path, "kill") in (
        [1],
        [1, 0],
    )  # itself: the kernel protects a namespace's first process
    assert new_case(fork_server, tmp_path, "traces")["kept"] == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "message"),
    [("exit", "exit status 7"), ("abort", "crashed with"), (int(signal.SIGKILL), ""), (int(signal.SIGSEGV), "")],
)
def test_exit_of_a_forked_child_is_reported(
    how: str | int, message: str, fork_server: ForkServer, tmp_path: Path
) -> None:
    for _ in range(2):
        try:
            assert new_case(fork_server, tmp_path, "end", how) == "alive"
            assert not message  # the first process of a namespace is not ended by its own signal
        except SubmissionError as wrong:
            assert message in wrong.message
    assert new_case(fork_server, tmp_path, "traces")["kept"] == 1


@pytest.mark.slow
def test_concurrent_process_gets_a_separate_sandbox(fork_server: ForkServer, tmp_path: Path) -> None:
    with (
        Student(tmp_path, "sandbox", fork_server=fork_server) as one,
        Student(tmp_path, "sandbox", fork_server=fork_server) as other,
    ):
        one.call("mine.py", "leave", "file")
        assert "left" not in other.call("mine.py", "traces")["scratch"]
        assert "left" in one.call("mine.py", "traces")["scratch"]


@pytest.mark.slow
def test_killed_sandbox_raises_grader_error_and_is_restarted(fork_server: ForkServer, tmp_path: Path) -> None:
    new_case(fork_server, tmp_path, "traces")
    assert fork_server._process is not None
    assert fork_server._socket is not None
    os.kill(fork_server._process.pid, signal.SIGKILL)
    far_end = select.poll()
    far_end.register(fork_server._socket, 0)  # the inner processes end a moment later, and answer until then
    assert far_end.poll(60_000.0)
    with pytest.raises(GraderError, match="could not be started"):
        new_case(fork_server, tmp_path, "traces")
    assert new_case(fork_server, tmp_path, "traces")["kept"] == 1


@pytest.mark.slow
def test_submission_finds_no_traces_of_the_previous_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not is_root():
        pytest.skip("there are copies for root alone")
    place = tmp_path / "place"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    found, sandboxes = [], set()
    with ForkServer("sandbox", Limits()) as fork_server:
        for name in ("ada", "bob"):
            folder = tmp_path / name
            (folder / f"of_{name}").mkdir(parents=True)
            (folder / "mine.py").write_text(PROGRAM)
            (folder / "mine.py").chmod(0o600)  # only its owner may read it
            (folder / "elsewhere").symlink_to("/etc")
            with fork_server.with_submission(folder):
                found.append(new_case(fork_server, folder, "traces"))
                assert fork_server._process is not None
                sandboxes.add(fork_server._process.pid)
            (shown,) = place.iterdir()
            assert list(shown.iterdir()) == []
            assert (folder / "mine.py").exists()
    assert [one.pop("files") for one in found] == [["elsewhere", "mine.py", f"of_{name}"] for name in ("ada", "bob")]
    assert found[0] == found[1]
    assert len(sandboxes) == 1
    assert list(place.iterdir()) == []


@pytest.mark.slow
def test_unclosed_process_ends_before_the_next_submission(fork_server: ForkServer, tmp_path: Path) -> None:
    student = Student(tmp_path, "sandbox", fork_server=fork_server)
    student.call("mine.py", "traces")
    with fork_server.with_submission(tmp_path):
        pass
    assert fork_server._process is None  # the whole sandbox went, and the process with it
    with pytest.raises(GraderError), student:
        student.call("mine.py", "traces")


@pytest.mark.slow
def test_other_submission_gets_a_separate_sandbox(
    fork_server: ForkServer, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    other = tmp_path_factory.mktemp("other")
    (other / "mine.py").write_text("def traces():\n    return 'of the other'\n")
    other.chmod(0o755)
    assert new_case(fork_server, other, "traces") == "of the other"
    assert fork_server._process is None
