"""Attacks succeed without the wall that stops them. With it: test_class_of_sixty.py."""

import csv
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.grading import test_confinement, test_fork_server, test_sandbox

Handed = Callable[..., list[Path]]
ATTACKS = {path.stem: path.read_text() for path in (Path(__file__).parent / "attacks").rglob("*.py")}
PROBES = {"confinement": test_confinement.PROBE, "sandbox": test_sandbox.PROBE, "forks": test_fork_server.PROGRAM}
HARM = re.compile(r"os\.kill(?!\(os\.getpid\(\))|fork|mkfifo|mkdir|write_text|write_bytes|\"[awx]b?\"|unshare|shmget")
HARMLESS = ("looks_around", "reads_the_parent", "shouts_into_the_network", "takes_another_core")


def grade(lab: Path, given: list[Path], folder: Path, *words: str) -> dict[str, float]:
    (folder / "the_secret").write_text("correct horse battery staple")
    start = [sys.executable, "-m", "snr_sim", "grade", str(lab), *map(str, given), "--out", str(folder / "out")]
    command = [*start, "--secret", str(folder / "the_secret"), *words]
    subprocess.run(command, check=True, capture_output=True)
    with (folder / "out" / "class.csv").open(newline="") as file:
        return {row["submission"]: float(row["points"]) for row in csv.DictReader(file)}


@pytest.mark.slow
@pytest.mark.parametrize("isolation", ["none", "required"])
def test_attacks_score_without_sandbox_and_fail_with_it(
    sandbox: None, double_lab: Path, listener: tuple[int, list[str]], tmp_path: Path, isolation: str
) -> None:
    given = []
    for name in HARMLESS:
        folder = tmp_path / "submissions" / name
        folder.mkdir(parents=True)
        shutil.copy(Path(__file__).parent / "attacks" / f"{name}.py", folder / "double.py")
        (folder / "port.txt").write_text(str(listener[0]))
        given.append(folder)
    points = grade(double_lab, given, tmp_path, "--isolation", isolation)
    assert points == dict.fromkeys(HARMLESS, 100.0 if isolation == "none" else 0.0)
    assert (listener[1] != []) == (isolation == "none")


@pytest.mark.slow
def test_output_of_hidden_cases_is_not_in_student_reports(
    sandbox: None, double_lab: Path, handed_in: Handed, tmp_path: Path
) -> None:
    """Output, errors and answers that contain the input appear only in the instructor's report."""
    lines = ["print('printed', x)", "if x > 9: raise ValueError(f'given {x}')", "return 2 * x"]
    leaks = "def double(x):\n" + "".join(f"    {line}\n" for line in lines)
    assert grade(double_lab, handed_in(leaks=leaks), tmp_path) == {"leaks": 70.0}
    kept = (tmp_path / "out" / "results" / "leaks.json").read_text()
    assert "given" in kept
    for path in (tmp_path / "out" / "students" / "leaks").iterdir():
        text = path.read_text()
        assert "given" not in text
        assert "printed 5" not in text
        assert "0 of 1 passed" in text


def test_pytest_ignores_attacks_and_labs(pytestconfig: pytest.Config) -> None:
    """It imports whatever it collects, to look for doctests: attacks would be in its own process."""
    conftest = pytestconfig.pluginmanager.get_plugin(str(Path(__file__).parent / "conftest.py"))
    assert conftest is not None
    assert conftest.collect_ignore_glob == ["attacks/*", "labs/*"]


@pytest.mark.parametrize("name", [*ATTACKS, *PROBES])
def test_program_that_could_harm_this_computer_acts_only_in_isolation(name: str) -> None:
    text = (ATTACKS | PROBES)[name]
    guard = text.find("assert os.getuid() >= 61184")
    harm = HARM.search(text)
    assert harm is None or -1 < guard < harm.start()
