"""Reference solutions and wrong ones stand here, out of the wheel; they run as a student's files, not by themselves."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab import find_lab

collect_ignore_glob = ["*/reference/*", "*/wrong/*"]

ROOT = Path(__file__).parents[2]
SECRET = b"the secret of these tests"


class Mark(NamedTuple):
    """What a submission came to: points that each check has cost, and all that the student is told."""

    lost: dict[str, float]
    told: str


@pytest.fixture
def mark(tmp_path: Path) -> Callable[..., Mark]:
    """Returns a function that grades a lab's reference, or the starter, with the files of a wrong solution over it."""

    def mark(lab: str, wrong: str = "", *, starter: bool = False, is_hidden: bool = False) -> Mark:
        here = Path(__file__).parent / lab.partition("_")[2]
        handed_in = tmp_path / "handed_in"
        folders = [ROOT / "assignments" / lab / "starter" if starter else here / "reference"]
        for folder in [*folders, here / "wrong" / wrong] if wrong else folders:
            shutil.copytree(folder, handed_in, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
        graded = grade_submission(find_lab(lab), handed_in, SECRET if is_hidden else None, isolation="none")
        assert graded.status == "graded", graded.error
        cases = [case for check in graded.checks for case in check.cases if not case.is_passed]
        told = "\n".join(text for case in cases for text in (case.hint, case.error, case.actual))
        lost = {one.name: round(one.of - one.points, 3) for one in graded.checks if not one.is_passed}
        assert "Traceback" not in told
        return Mark(lost, told)

    return mark


@pytest.fixture
def type_page(tmp_path: Path) -> Callable[..., dict[str, str]]:
    """Returns a function that types every command of a page's shell blocks, and checks its exit status.

    It must be 0, or what the remark behind the command says: "# exit status 1: ...". `after` names what is done after
    the first command that holds a text. Returns what each command printed, errors last.
    """

    def type_page(page: Path, after: Mapping[str, Callable[[Path], None]]) -> dict[str, str]:
        (tmp_path / "assignments").symlink_to(ROOT / "assignments")
        (tmp_path / "bin").mkdir()
        for name, argument in (("snr", "-m snr_sim "), ("python3", "")):
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
                said = re.search(r"exit status (\d)", remark)
                assert done.returncode == (int(said[1]) if said else 0), (command, done.stdout, done.stderr)
                printed[command.strip()] = done.stdout + done.stderr
                for text in [text for text in left if text in command]:
                    left.pop(text)(tmp_path)
        assert not left, "no command holds this"
        return printed

    return type_page
