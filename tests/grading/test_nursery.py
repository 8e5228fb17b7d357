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
from snr_sim.grading.lab.verdicts import LabFault, Misbehaved
from snr_sim.grading.remote.nursery import Nursery
from snr_sim.grading.sandbox.sandbox import Limits, is_root

PROGRAM = '''
import os, sys

kept = []


def traces():
    """What tells one case from another."""
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

pytestmark = pytest.mark.usefixtures("sandbox")


@pytest.fixture
def nursery(tmp_path: Path) -> Iterator[Nursery]:
    if not is_root():
        pytest.skip("there are copies for root alone")
    (tmp_path / "mine.py").write_text(PROGRAM)
    tmp_path.chmod(0o755)
    with Nursery("sandbox", Limits()) as nursery, nursery.holding(tmp_path):
        yield nursery


def asked(nursery: Nursery, folder: Path, function: str, *args: Any) -> Any:
    """Return the answer of a new case."""
    with Student(folder, "sandbox", nursery=nursery) as student:
        return student.call("mine.py", function, *args)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["nothing", "file", "trace of a file", "segment", "module"])
def test_a_case_finds_nothing_that_another_has_left(
    what: str, namespaces_alone: None, nursery: Nursery, tmp_path: Path
) -> None:
    first = asked(nursery, tmp_path, "traces")
    asked(nursery, tmp_path, "leave", what)
    assert asked(nursery, tmp_path, "traces") == first
    assert (first["kept"], first["segment"]) == (1, -1)


@pytest.mark.slow
def test_a_sandbox_is_kept_until_somebody_has_written_in_it(nursery: Nursery, tmp_path: Path) -> None:
    def sandbox() -> Any:
        assert nursery._process is not None
        return nursery._process.pid

    asked(nursery, tmp_path, "traces")
    first = sandbox()
    asked(nursery, tmp_path, "traces")
    assert sandbox() == first
    asked(nursery, tmp_path, "leave", "file")
    asked(nursery, tmp_path, "traces")
    assert sandbox() != first


@pytest.mark.slow
def test_a_case_cannot_end_what_the_next_one_is_a_copy_of(
    namespaces_alone: None, nursery: Nursery, tmp_path: Path
) -> None:
    assert asked(nursery, tmp_path, "kill") in ([1], [1, 0])  # itself: the kernel protects a namespace's first process
    assert asked(nursery, tmp_path, "traces")["kept"] == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "told"),
    [("exit", "exit status 7"), ("abort", "crashed with"), (int(signal.SIGKILL), ""), (int(signal.SIGSEGV), "")],
)
def test_how_a_copy_ends_is_told_as_of_any_process(how: str | int, told: str, nursery: Nursery, tmp_path: Path) -> None:
    for _ in range(2):
        try:
            assert asked(nursery, tmp_path, "end", how) == "alive"
            assert not told  # the first process of a namespace is not ended by its own signal
        except Misbehaved as wrong:
            assert told in wrong.message
    assert asked(nursery, tmp_path, "traces")["kept"] == 1


@pytest.mark.slow
def test_a_second_process_at_once_gets_a_sandbox_of_its_own(nursery: Nursery, tmp_path: Path) -> None:
    with (
        Student(tmp_path, "sandbox", nursery=nursery) as one,
        Student(tmp_path, "sandbox", nursery=nursery) as other,
    ):
        one.call("mine.py", "leave", "file")
        assert "left" not in other.call("mine.py", "traces")["scratch"]
        assert "left" in one.call("mine.py", "traces")["scratch"]


@pytest.mark.slow
def test_a_sandbox_that_is_gone_is_no_fault_of_the_students(nursery: Nursery, tmp_path: Path) -> None:
    asked(nursery, tmp_path, "traces")
    assert nursery._process is not None
    assert nursery._socket is not None
    os.kill(nursery._process.pid, signal.SIGKILL)
    far_end = select.poll()
    far_end.register(nursery._socket, 0)  # the kernel ends the inner processes a moment later; until then they answer
    assert far_end.poll(60_000.0)
    with pytest.raises(LabFault, match="could not be started"):
        asked(nursery, tmp_path, "traces")
    assert asked(nursery, tmp_path, "traces")["kept"] == 1


@pytest.mark.slow
def test_a_submission_finds_nothing_of_the_one_before_in_the_same_sandbox(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not is_root():
        pytest.skip("there are copies for root alone")
    place = tmp_path / "place"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    found, sandboxes = [], set()
    with Nursery("sandbox", Limits()) as nursery:
        for name in ("ada", "bob"):
            folder = tmp_path / name
            (folder / f"of_{name}").mkdir(parents=True)
            (folder / "mine.py").write_text(PROGRAM)
            (folder / "mine.py").chmod(0o600)  # only its owner may read it
            (folder / "elsewhere").symlink_to("/etc")
            with nursery.holding(folder):
                found.append(asked(nursery, folder, "traces"))
                assert nursery._process is not None
                sandboxes.add(nursery._process.pid)
            (shown,) = place.iterdir()
            assert list(shown.iterdir()) == []
            assert (folder / "mine.py").exists()
    assert [one.pop("files") for one in found] == [["elsewhere", "mine.py", f"of_{name}"] for name in ("ada", "bob")]
    assert found[0] == found[1]
    assert len(sandboxes) == 1
    assert list(place.iterdir()) == []


@pytest.mark.slow
def test_a_process_that_nobody_has_ended_does_not_see_the_next_submission(nursery: Nursery, tmp_path: Path) -> None:
    student = Student(tmp_path, "sandbox", nursery=nursery)
    student.call("mine.py", "traces")
    with nursery.holding(tmp_path):
        pass
    assert nursery._process is None  # the whole sandbox went, and the process with it
    with pytest.raises(LabFault), student:
        student.call("mine.py", "traces")


@pytest.mark.slow
def test_another_submission_than_the_one_that_is_held_gets_a_sandbox_of_its_own(
    nursery: Nursery, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    other = tmp_path_factory.mktemp("other")
    (other / "mine.py").write_text("def traces():\n    return 'of the other'\n")
    other.chmod(0o755)
    assert asked(nursery, other, "traces") == "of the other"
    assert nursery._process is None
