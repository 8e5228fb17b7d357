"""References and mistakes of the labs are here, outside the wheel; they run as a student's files, not by themselves.

`mark` grades one as a submission is graded, each case in a process of its own. But a new process takes half a second to
import the kit, and the labs' tests would need thousands. So one process imports it once, and each case has a copy (a
fork) of that one, with nothing of a student's in it.
"""

import io
import os
import re
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import Check, Lab, find_lab, load_lab
from snr_sim.grading.remote import launch
from snr_sim.grading.remote.launch import environment
from tests.assignments.mistakes import write_solution, write_starter

collect_ignore_glob = ["*/reference/*"]

ROOT = Path(__file__).parents[2]
SECRET = b"the secret of these tests"


# Modules of the kit that most copies need are imported here once: importing them in each took a tenth of the CPU time.
# It runs each command in a copy of itself, as if Python were started with it. Each command comes with two descriptors:
# the line to answer on, which the command knows by its number, and where prints go.
WARM = """
import os, signal, socket, struct, sys
sys.path[:] = {path!r}
import fcntl, numpy.ma, numpy.random, numpy.typing, resource, tomllib
from snr_sim import Endpoint, EndpointFactory, Loop, LoopFactory, Node, TaskType
from snr_sim.behaviors import endpoint, explore, language
from snr_sim.core import lockstep, runners
from snr_sim.devices import simulated, terminal_keys
from snr_sim.devices.sensors import camera
from snr_sim.devices.sensors import echo_sounder
from snr_sim.devices.sensors import hull_sensors
from snr_sim.devices.sensors import imu
from snr_sim.devices.sensors import ms5837
from snr_sim.grading.remote import child
from snr_sim.grading.remote import child_node
from snr_sim.plants.urov import t200
from snr_sim.plants.urov import vehicle_file
from snr_sim.scenario import machine_controller
from snr_sim.std_mods import allocation, slew, thrust_curve
from snr_sim import links, teleop
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
asked = socket.socket(fileno={line})
while True:
    message, (line, output), _, _ = socket.recv_fds(asked, 1 << 16, 2)
    copied = os.fork()
    if copied == 0:
        folder, number, command = message.decode().split("\\0")
        os.setsid()
        asked.close()
        os.chdir(folder)
        os.dup2(output, 1), os.dup2(output, 2), os.close(output)
        if line != int(number):
            os.dup2(line, int(number)), os.close(line)
        exec(command)
        os._exit(1)
    os.close(line), os.close(output)
    asked.send(struct.pack("i", copied))
"""


class WarmProcess:
    """The process that is copied."""

    def __init__(self) -> None:
        here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        program = WARM.format(path=sys.path, line=there.fileno())
        command = [sys.executable, "-P", "-s", "-S", "-c", program]
        # To a pipe, as its copies print: what sys.stdout is was settled when it began.
        self.process = subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, pass_fds=(there.fileno(),))
        self.socket = here
        there.close()

    def copy(self, folder: Path, command: str, line: int, output: int) -> int:
        """Return the number of a copy that does this, in this folder."""
        socket.send_fds(self.socket, ["\0".join((str(folder), str(line), command)).encode()], [line, output])
        number: int = struct.unpack("i", self.socket.recv(4))[0]
        return number

    def close(self) -> None:
        """End it."""
        self.process.kill()
        self.process.communicate()
        self.socket.close()


class Copy:
    """A copy, with what `ChildProcess` asks of a process."""

    def __init__(self, number: int, output: int) -> None:
        self.pid = number
        self.stdout = io.FileIO(output)

    def poll(self) -> int | None:
        """Return None: it is not a child of this process, so its exit status is unknown."""
        return None

    def wait(self, timeout_s: float = 0.0) -> None:
        """Do nothing: after SIGKILL the kernel ends it."""

    def kill(self) -> None:
        """End it."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)


@pytest.fixture(scope="session")
def warm() -> Iterator[WarmProcess]:
    process = WarmProcess()
    yield process
    process.close()


@pytest.fixture
def warm_children(warm: WarmProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """Has the grader's student processes be copies of the warm one."""

    def popen(command: list[str], cwd: Path, pass_fds: tuple[int], **_: Any) -> Copy:
        reader, writer = os.pipe()
        number = warm.copy(cwd, command[-1], pass_fds[0], writer)
        os.close(writer)
        return Copy(number, reader)

    class Subprocess:
        """`subprocess` as `launch` sees it."""

        Popen, DEVNULL, PIPE, STDOUT = staticmethod(popen), subprocess.DEVNULL, subprocess.PIPE, subprocess.STDOUT

    monkeypatch.setattr(launch, "subprocess", Subprocess)


def one_hidden(check: Check) -> Check:
    """Return a check with one of its hidden cases, and no others."""
    draw = check.hidden
    assert draw is not None
    return replace(check, visible=(), hidden=lambda rng: draw(rng)[:1])


class Mark(NamedTuple):
    """Result of a submission: the points that each check has cost, and the feedback for the student."""

    lost: dict[str, float]
    feedback: str


@pytest.fixture
def mark(tmp_path: Path, warm_children: None) -> Callable[..., Mark]:
    """Return a function that grades a lab's reference, or a mistake of its table, or its starter alone.

    `single_hidden` are checks whose cases are flights, which take long: of these one that is hidden is enough.
    """

    def mark(
        lab: str,
        mistake: str = "",
        *,
        starter: bool = False,
        is_hidden: bool = False,
        single_hidden: Collection[str] = (),
    ) -> Mark:
        handed_in = tmp_path / "handed_in"
        if starter:
            write_starter(lab, handed_in)
        else:
            write_solution(lab, handed_in, mistake)
        checks = find_lab(lab)
        checks.checks = tuple(one_hidden(check) if check.name in single_hidden else check for check in checks.checks)
        graded = grade_submission(checks, handed_in, SECRET if is_hidden else None, isolation="none")
        assert graded.status == "graded", graded.error
        cases = [case for check in graded.checks for case in check.cases if not case.is_passed]
        feedback = "\n".join(text for case in cases for text in (case.hint, case.error, case.actual))
        lost = {one.name: round(one.max_points - one.points, 3) for one in graded.checks if not one.is_passed}
        assert "Traceback" not in feedback
        return Mark(lost, feedback)

    return mark


@pytest.fixture
def type_page(tmp_path: Path) -> Callable[..., dict[str, str]]:
    """Return a function that types every command of a page's shell blocks, and checks its exit status.

    It must be 0, or what the remark behind the command says: "# exit status 1: ...". `after` names what is done after
    the first command that holds a text. Returns what each command printed, errors last.
    """

    def type_page(page: Path, after: Mapping[str, Callable[[Path], None]]) -> dict[str, str]:
        (tmp_path / "assignments").symlink_to(ROOT / "assignments")
        (tmp_path / "bin").mkdir()
        for name, argument in (("snr", "-m snr_sim "), ("python3", ""), ("python", "")):
            script = tmp_path / "bin" / name
            script.write_text(f'#!/bin/sh\nexec "{sys.executable}" {argument}"$@"\n')
            script.chmod(0o755)
        environment = {**os.environ, "PATH": f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}"}
        left = dict(after)
        printed = {}
        for block in re.findall(r"```sh\n(.*?)```", page.read_text(), flags=re.DOTALL):
            for typed in block.splitlines():
                command, _, remark = typed.partition("  #")
                # A view for each run would take long.
                line = re.sub(r"^snr (run|resim) (?!.*--no-rrd)", r"snr \1 --no-rrd ", command.strip())
                done = subprocess.run(line, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True)
                expected_status = re.search(r"exit status (\d)", remark)
                assert done.returncode == (int(expected_status[1]) if expected_status else 0), (
                    command,
                    done.stdout,
                    done.stderr,
                )
                printed[command.strip()] = done.stdout + done.stderr
                for text in [text for text in left if text in command]:
                    left.pop(text)(tmp_path)
        assert not left, "no command holds this"
        return printed

    return type_page


@pytest.fixture
def choose_checks(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that has only those checks of a lab tried of which another function is true."""

    def choose(is_tried: Callable[[Check], bool]) -> None:
        def load(path: Path) -> Lab:
            lab = load_lab(path)
            lab.checks = tuple(filter(is_tried, lab.checks))
            return lab

        monkeypatch.setattr("snr_sim.grading.lab.lab.load_lab", load)

    return choose


@pytest.fixture
def leave_out(choose_checks: Callable[..., None]) -> Callable[..., None]:
    """Return a function that has some checks not tried: flights take long, and most mistakes show without."""
    return lambda *names: choose_checks(lambda check: check.name not in names)


@pytest.fixture
def try_only(choose_checks: Callable[..., None]) -> Callable[..., None]:
    """Return a function that has no other checks tried than some: those that a mistake loses."""
    return lambda *names: choose_checks(lambda check: check.name in names)
