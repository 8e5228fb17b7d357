"""Rich prints texts literally on a terminal, even if a name or a hint looks like markup."""

import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest

from snr_sim.cli.plain_console import escape_markup, plain_console

CHECKS = """
from snr_sim.grading import Lab, check, failed, passed

@check(points=100, visible=[0, [1]], hidden=lambda rng: [2])
def doubles(student, x):
    \"\"\"[/] is [red]:x:\"\"\"
    given = x[0] if isinstance(x, list) else x
    return passed() if student.call("double.py", "double", given) == 2 * given else failed("[/] no [us] :x:")

lab = Lab("[/] Double", files=["double.py"], checks=[doubles])
"""


def on_a_terminal(folder: Path, *words: str) -> tuple[int, str]:
    """What a command says on a terminal of its own, and its exit status."""
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "snr_sim", *words]
    with subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, cwd=folder) as process:
        os.close(slave)
        output = b""
        while chunk := read(master):
            output += chunk
    os.close(master)
    return process.returncode, output.decode()


def read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 65536)
    except OSError:  # the far end has closed
        return b""


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "checks.py").write_text(CHECKS)
    (tmp_path / "lab" / "README.md").write_text("# Double\n")
    return tmp_path / "lab"


def hand_in(folder: Path, factor: int) -> Path:
    folder.mkdir(parents=True)
    (folder / "double.py").write_text(f"def double(x):\n    return {factor} * x\n")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("factor", [2, 3])
def test_case_names_and_hints_with_markup_are_printed(lab: Path, tmp_path: Path, factor: int) -> None:
    folder = hand_in(tmp_path / "mine", factor)
    status, output = on_a_terminal(folder, "check", str(lab))
    assert status == (0 if factor == 2 else 1), output
    assert "[/] Double: practice" in output
    assert "[/] is [red]:x:" in output
    assert ("[/] no [us] :x:" in output) == (factor == 3)


def test_markup_in_text_is_not_interpreted(capfd: pytest.CaptureFixture[str]) -> None:
    plain_console(width_in_a_pipe=100).print("[/] later [ms] :x: 12")
    plain_console(stderr=True).print(escape_markup("[/] later [ms] :x: 12"))
    assert capfd.readouterr() == ("[/] later [ms] :x: 12\n",) * 2
