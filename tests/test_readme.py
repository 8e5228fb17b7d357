"""The README's programs do what it says."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from snr_sim import SimRunner

README = Path(__file__).parents[1] / "README.md"


def blocks() -> list[str]:
    return re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)


@pytest.mark.slow
def test_the_controller_of_the_readme_lands_with_about_twice_the_fuel(tmp_path: Path) -> None:
    (tmp_path / "gentle.py").write_text(blocks()[0])
    command = [sys.executable, "-m", "snr_sim", "run", "lander_vertical", "--controller", "./gentle.py", "--no-rrd"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    ratio = float(re.search(r"fuel_ratio +([0-9.]+)", done.stdout)[1])  # type: ignore[index]
    assert 1.8 < ratio < 2.2


@pytest.mark.slow
def test_the_test_of_the_readme_passes_and_fails_with_another_controller(tmp_path: Path) -> None:
    (tmp_path / "gentle.py").write_text(blocks()[0])
    (tmp_path / "test_gentle.py").write_text(blocks()[1])
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_gentle.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    # Of another length: what changes within a second and keeps its length, Python takes from its bytecode.
    (tmp_path / "gentle.py").write_text(blocks()[0].replace("self.hover + 0.1", "self.hover - 0.10"))
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stdout


def test_the_readme_names_what_its_tests_need() -> None:
    section = README.read_text().partition("## Tests of your own")[2].partition("\n## ")[0]
    installed = re.findall(r"pip install (.+)", section)[0].split()
    settings = tomllib.loads((README.parent / "pyproject.toml").read_text())["tool"]["pytest"]["ini_options"]
    needed = ["pytest", *(["pytest-xdist"] if "--dist" in settings["addopts"] else [])]
    assert installed == needed


def test_every_command_the_readme_names_exists() -> None:
    from snr_sim.cli.verbs import VERBS

    named = set(re.findall(r"\bsnr ([a-z]+)\b", README.read_text()))
    assert named - {"view"} <= set(VERBS)


def test_the_two_computers_of_the_readme_meet_in_lock_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SNR_SECRET", "a secret of more than 16 bytes")
    names: dict[str, Any] = {}
    exec(blocks()[2], names)
    runner = SimRunner(names["config"], until_s=2.0)
    runner.run()
    assert [runner.nodes[role].get_data("link_tether")["up"] for role in ("robot", "topside")] == [True, True]


def test_the_two_roles_of_the_readme_show_the_depth_topside(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {"__name__": "rov"}
    exec(blocks()[3], names)
    SimRunner(names["config"], until_s=2.0).run()
    assert "1.5 m\n" in capsys.readouterr().out
