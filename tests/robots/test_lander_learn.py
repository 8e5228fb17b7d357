"""The lander's two trainings from a shell: what would fail at the end is reported before the start."""

import subprocess
import sys
from pathlib import Path

import pytest

from snr_sim.scenario.library import find

pytestmark = pytest.mark.slow

LANDER = find("robots", "lander").path


def run(script: str, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, LANDER / script, *words], capture_output=True, text=True)


@pytest.mark.parametrize("script", ["learn.py", "learn_pad.py"])
def test_missing_folder_is_reported_before_training(script: str, tmp_path: Path) -> None:
    done = run(script, "--out", str(tmp_path / "nowhere" / "policy.npz"))
    assert done.returncode == 2
    assert f"there is no folder {tmp_path / 'nowhere'}. Make it, or name a file in another one." in done.stderr


@pytest.mark.parametrize("script", ["learn.py", "learn_pad.py"])
def test_invalid_seed_prints_error(script: str, tmp_path: Path) -> None:
    done = run(script, "--seed", "-1", "--out", str(tmp_path / "policy.npz"))
    assert done.returncode == 1
    assert done.stderr.lstrip().startswith("Error: A training with seed=-1.")  # an older rich ends its bar by a line
    assert not list(tmp_path.iterdir())
