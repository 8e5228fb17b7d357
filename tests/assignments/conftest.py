"""References and mistakes of the labs are here, outside the wheel; they run as a student's files, not by themselves.

`mark` grades one as a submission is graded, each case in a process of its own: a copy of one process of all tests.
"""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from snr_sim.grading import grade
from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab import submission
from snr_sim.grading.lab.lab import Check, Lab, find_lab, load_lab
from snr_sim.grading.remote import launch
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.remote.student_process import StudentProcess
from snr_sim.grading.sandbox.sandbox import Limits
from tests.assignments.mistakes import write_solution, write_starter

collect_ignore_glob = ["*/reference/*"]

ROOT = Path(__file__).parents[2]
SECRET = b"the secret of these tests"


# Modules of the kit that most copies need are imported once: importing them in each took a tenth of the CPU time.
WARM = """
    fcntl numpy.ma numpy.random numpy.typing resource tomllib snr_sim.behaviors.endpoint snr_sim.behaviors.explore
    snr_sim.behaviors.language snr_sim.core.lockstep snr_sim.core.runners snr_sim.devices.readings
    snr_sim.devices.terminal_keys snr_sim.devices.sensors.camera snr_sim.devices.sensors.echo_sounder
    snr_sim.devices.sensors.hull_sensors snr_sim.devices.sensors.imu snr_sim.devices.sensors.ms5837
    snr_sim.plants.urov.t200 snr_sim.plants.urov.vehicle_file snr_sim.links snr_sim.teleop
    snr_sim.scenario.machine_controller snr_sim.std_mods.allocation snr_sim.std_mods.slew
    snr_sim.std_mods.thrust_curve
"""


@pytest.fixture(scope="session")
def warm() -> Iterator[ForkServer]:
    begin = launch.start_command

    def warmed(*args: Any, **more: Any) -> tuple[list[str], Path]:
        command, folder = begin(*args, **more)
        return [*command[:-1], command[-1].replace("; main(", f"; import {', '.join(WARM.split())}; main(")], folder

    with ForkServer("none", Limits()) as fork_server, pytest.MonkeyPatch.context() as patch:
        patch.setattr(launch, "start_command", warmed)
        child = StudentProcess(ROOT, "none", Limits(), fork_server=fork_server)  # starts the process that is copied
        child.close()
        patch.undo()
        yield fork_server


@pytest.fixture
def warm_children(warm: ForkServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Has the grader's student processes be copies of one process."""
    monkeypatch.setattr(grade, "ForkServer", lambda *_: nullcontext(warm))
    monkeypatch.setattr(submission, "StudentProcess", lambda *args: StudentProcess(*args[:-1], warm))


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
