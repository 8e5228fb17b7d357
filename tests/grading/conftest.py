"""Minimal lab for tests of the grader: double a number. And fixtures of the attacks."""

import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from snr_sim.grading.remote import launch
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.remote.isolation import find_isolation
from snr_sim.grading.sandbox.sandbox import IsolationMissingError, Limits

# They run in the sandbox, and never in pytest, which imports whatever it collects.
collect_ignore_glob = ["attacks/*", "labs/*"]

LABS = Path(__file__).parent / "labs"
PROGRAMS = {
    "right": "def double(x):\n    return 2 * x\n",
    "visible_only": "def double(x):\n    return {1: 2, 2: 4, 4: 8}.get(x, 0)\n",
    "raises": "def double(x):\n    raise ValueError(f'I got {x}')\n",
    "finds_a_fault": "def double(x):\n    return 2 if x == 1 else 13\n",
    "talks_nonsense": "def double(x):\n    return 2 if x == 1 else 'nonsense'\n",
    "quits": "import sys\n\n\ndef double(x):\n    sys.exit(0)\n",
}


@pytest.fixture
def double_lab(tmp_path: Path) -> Path:
    """Return the folder of the lab; tests may rewrite it."""
    return _copy_of(LABS / "01_double", tmp_path)


@pytest.fixture
def landing_lab(tmp_path: Path) -> Path:
    """Where a lab is that flies."""
    return _copy_of(LABS / "02_landing", tmp_path)


def _copy_of(lab: Path, folder: Path) -> Path:
    copy = folder / "assignments" / lab.name
    shutil.copytree(lab, copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


@pytest.fixture(scope="module")
def copying() -> Iterator[Callable[..., ForkServer]]:
    """Returns a function of limits that returns a fork server of a module's tests: starting Python takes 0.2 s."""
    with ExitStack() as stack:
        yield cache(lambda **limits: stack.enter_context(ForkServer("none", Limits(**limits))))


@pytest.fixture
def handed_in(tmp_path: Path) -> Callable[..., list[Path]]:
    """Returns a function that writes a submission for each student=program: a name above, a text, or "" for none."""

    def write(**students: str) -> list[Path]:
        paths = []
        for student, program in students.items():
            path = tmp_path / "submissions" / student
            path.mkdir(parents=True, exist_ok=True)
            if program:
                (path / "double.py").write_text(PROGRAMS.get(program, program))
            paths.append(path)
        return paths

    return write


@pytest.fixture
def listener() -> Iterator[tuple[int, list[str]]]:
    """Yield a port that no submission may reach, with and without a name, and the connections accepted there."""
    reached: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as tcp, socket.socket(socket.AF_UNIX) as unnamed:
        port = tcp.getsockname()[1]
        unnamed.bind(f"\0snr_attack_{port}")
        unnamed.listen()

        def listen(server: socket.socket) -> None:
            try:
                while True:
                    server.accept()[0].close()
                    reached.append(str(server.getsockname()))
            except OSError:
                return

        threads = [threading.Thread(target=listen, args=(server,), daemon=True) for server in (tcp, unnamed)]
        for thread in threads:
            thread.start()
        yield port, reached
        for server in (tcp, unnamed):
            server.shutdown(socket.SHUT_RDWR)


@pytest.fixture(scope="session")
def docker() -> list[str]:
    """Return the command prefix that runs a command as root in an ordinary Docker container, without a sandbox."""
    if os.geteuid() == 0 and _isolation_here() == "confined":
        return []  # this is one
    needed = [str(Path(one).resolve()) for one in (sys.base_prefix, sys.prefix, Path(__file__).parents[2])]
    prefix = [str(Path(__file__).parent / "as_in_docker"), ":".join(needed)]
    tried = subprocess.run([*prefix, "true"], capture_output=True, text=True) if os.geteuid() == 0 else None
    if tried is None or tried.returncode != 0 or not Path("/proc/sys/kernel/seccomp").is_dir():
        if os.environ.get("SNR_REQUIRE_SANDBOX") and os.geteuid() == 0:
            raise AssertionError(tried)
        pytest.skip("an ordinary container can be imitated by root only, who may mount")
    return prefix


def _isolation_here() -> str:
    try:
        return find_isolation()
    except IsolationMissingError:
        return ""


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """A folder that everybody may enter: not so those of pytest."""
    with tempfile.TemporaryDirectory(prefix="snr-test-") as name:
        Path(name).chmod(0o755)
        yield Path(name)


@pytest.fixture
def at_first(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Has a line of Python run in each student's process, before it puts up its walls."""
    begin = launch.start_command

    def run_at_first(line: str) -> None:
        def changed(*args: Any, **more: Any) -> tuple[list[str], Path]:
            command, folder = begin(*args, **more)
            return [*command[:-1], command[-1].replace("; main(", f"; {line}; main(")], folder

        monkeypatch.setattr(launch, "start_command", changed)

    return run_at_first


@pytest.fixture
def namespaces_alone(at_first: Callable[[str], None]) -> None:
    """Takes the filter of system calls down in sandboxes, so that the other walls are seen to stand by themselves."""
    at_first("from snr_sim.grading.sandbox import seccomp; seccomp.install = lambda program: 0")
