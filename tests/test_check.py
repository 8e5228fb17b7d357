"""`scripts/check` finds the tests that belong to a change, and the lanes are what CONTRIBUTING.md says."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType

import pytest

PROJECT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def check() -> ModuleType:
    """Return scripts/check as a module."""
    loader = SourceFileLoader("scripts_check", str(PROJECT / "scripts" / "check"))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ("tests/prelude/test_task.py", "tests/prelude/test_task.py"),
        ("snr_sim/prelude/task.py", "tests/prelude/test_task.py"),
        ("snr_sim/core/clocks.py", "tests/links/test_link.py"),  # which imports it
        ("tests/cli/conftest.py", "tests/cli/test_run.py"),
        ("robots/urov/robot.py", "tests/robots/test_urov.py"),
        ("scenarios/urov_gate.py", "tests/scenarios/test_urov.py"),
        ("assignments/02_depth_hold/checks.py", "tests/assignments/test_depth_hold.py"),
        ("README.md", "tests/test_readme.py"),
    ],
)
def test_changed_file_has_its_tests(check: ModuleType, changed: str, expected: str) -> None:
    assert expected in check.tests_of([changed], PROJECT)


def test_change_without_tests_has_none(check: ModuleType) -> None:
    assert check.tests_of(["LICENSE", "docs/landing.png"], PROJECT) == []


def test_every_marker_is_documented() -> None:
    text = (PROJECT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    configured = re.search(r"markers = \[(.*?)\]", (PROJECT / "pyproject.toml").read_text(encoding="utf-8"), re.DOTALL)
    assert configured is not None
    *lanes, other = re.findall(r'^    "(\w+)(?:\(.*\))?:', configured[1], re.MULTILINE)
    assert lanes == ["fast", "slow", "wall_clock", "nightly"]
    assert all(f"| `{lane}` |" in text for lane in lanes)
    assert f"`{other}`" in text


LANES = """
import select, signal, socket, subprocess, sys, time
import pytest

def test_plain(): pass
def test_starts_a_process(): subprocess.run([sys.executable, "-c", ""])
def test_opens_a_port(): socket.create_server(("127.0.0.1", 0)).close()
def test_waits(): select.select([], [], [], 1.2)
def test_naps():
    for _ in range(60): time.sleep(0.02)
def test_writes_often(tmp_path):
    for _ in range(2000): (tmp_path / "file").write_bytes(b"x")
def test_leaves_a_handler(): signal.signal(signal.SIGTERM, lambda number, frame: None)
def test_leaves_a_timer():
    signal.signal(signal.SIGALRM, signal.SIG_IGN)
    signal.setitimer(signal.ITIMER_REAL, 1000.0)
@pytest.mark.slow
def test_slow(): subprocess.run([sys.executable, "-c", ""])
@pytest.mark.slow
@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.nightly)])
def test_in_two_lanes(count): pass
@pytest.mark.wall_clock
def test_times(): pass
"""

LEAVES = {"leaves_a_handler", "leaves_a_timer"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "passed", "failed"),
    [
        (
            [],
            {"plain", "writes_often", *LEAVES},
            {"starts_a_process", "opens_a_port", "waits", "naps"},
        ),
        (["-m", "slow"], {"slow", "in_two_lanes[1]"}, set()),
        (["-m", "wall_clock"], {"times"}, set()),
        (["-m", "nightly"], {"in_two_lanes[2]"}, set()),
        (["-m", "fast or slow", "-k", "plain or test_slow"], {"plain", "slow"}, set()),
    ],
)
def test_lane_runs_its_tests_and_no_others(
    tmp_path: Path, words: list[str], passed: set[str], failed: set[str]
) -> None:
    for name in ("conftest.py", "pyproject.toml"):
        (tmp_path / name).write_text((PROJECT / name).read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_lanes.py").write_text(LANES)
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-rA", *words]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    found = {
        state: set(re.findall(rf"^{state} tests/test_lanes.py::test_(\S+)", done.stdout, re.MULTILINE))
        for state in ("PASSED", "FAILED", "ERROR")
    }
    assert found["ERROR"] == LEAVES & passed
    assert (found["PASSED"], found["FAILED"]) == (passed, failed), done.stdout + done.stderr
    assert ("The rest:" in done.stdout) is (words == [])
