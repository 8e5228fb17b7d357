"""`scripts/measure`: its counts of a small tree, and that it reads this one."""

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "scripts" / "measure"
ONE = '''"""Docs."""
from snr_sim import two  # a remark


class Public:
    def method(self, x):
        return [one for one in x if one and x] if x else None

    def _private(self): ...
'''
TWO = "def f():\n    from snr_sim.one import Public\n"


def measured(top: Path) -> str:
    return subprocess.run([sys.executable, SCRIPT, top], capture_output=True, text=True, check=True).stdout


@pytest.mark.slow
def test_counts_of_a_small_tree_are_exact(tmp_path: Path) -> None:
    (tmp_path / "snr_sim").mkdir()
    for name, text in (("__init__", ""), ("one", ONE), ("two", TWO)):
        (tmp_path / "snr_sim" / f"{name}.py").write_text(text)
    lines = measured(tmp_path).splitlines()
    # Public, method and f; complexity 1, 1, and 1 + if + for + if + and
    assert lines[1].split() == ["snr_sim", "3", "11", "2", "9", "9", "3", "2.0/4/4", "0"]
    assert "circles of imports: 1" in lines
    assert "  snr_sim.one, snr_sim.two" in lines


@pytest.mark.slow
def test_this_tree_has_no_circle() -> None:
    assert runpy.run_path(str(SCRIPT))["circles"](SCRIPT.parents[1] / "snr_sim") == []
