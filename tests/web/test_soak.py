"""The soak test of tests/bench: a machine that is edited twice a second, by browsers that are killed."""

import subprocess
import sys
from pathlib import Path

import pytest

SOAK = Path(__file__).parents[1] / "bench" / "soak_edits.py"


@pytest.mark.nightly(minutes=1.5)
def test_edits_twice_a_second_lose_no_step_and_nothing_grows() -> None:
    done = subprocess.run([sys.executable, SOAK, "--minutes", "1"], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "nothing lost, nothing grew" in done.stdout
