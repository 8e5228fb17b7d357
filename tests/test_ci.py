"""The landing script finds the other Pythons, whatever a version manager puts on the path."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[1]
BROKEN_SHIM = "#!/bin/sh\necho 'python3.12: command not found' >&2\nexit 127\n"
WORKING = f'#!/bin/sh\nexec "{sys.executable}" "$@"\n'
PRINTS_ITS_NAME = '#!/bin/sh\necho "$0"\n'


def write(file: Path, text: str) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    file.chmod(0o755)
    return file


@pytest.fixture
def python_of(tmp_path: Path) -> str:
    """Return a script that prints what .ci/lib's own function answers for 3.12."""
    found = re.search(r"^python_of\(\) \{\n.*?^\}\n", (PROJECT / ".ci" / "lib").read_text(), re.DOTALL | re.MULTILINE)
    assert found is not None
    return f'set -euo pipefail\n{found[0]}\nfound=$(python_of 3.12)\nprintf %s "$found"'


def answer(code: str, folder: Path) -> str:
    environment = {"PATH": f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}", "PYENV_ROOT": str(folder / "pyenv")}
    done = subprocess.run(["bash", "-c", code], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_working_python_on_path_is_used(tmp_path: Path, python_of: str) -> None:
    write(tmp_path / "bin" / "python3.12", WORKING)
    assert answer(python_of, tmp_path) == sys.executable


@pytest.mark.slow
def test_failing_shim_falls_back_to_newest_installed_python(tmp_path: Path, python_of: str) -> None:
    write(tmp_path / "bin" / "python3.12", BROKEN_SHIM)
    for patch in (1, 9, 10):
        newest = write(tmp_path / "pyenv" / "versions" / f"3.12.{patch}" / "bin" / "python", PRINTS_ITS_NAME)
    assert answer(python_of, tmp_path) == str(newest)


@pytest.mark.slow
def test_missing_python_prints_nothing_and_script_continues(tmp_path: Path, python_of: str) -> None:
    write(tmp_path / "bin" / "python3.12", BROKEN_SHIM)
    assert answer(python_of, tmp_path) == ""
