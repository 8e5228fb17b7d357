"""The soak test of tests/bench: three seconds in the slow lane, too short to measure growth; ten minutes in nightly."""

import subprocess
import sys
from pathlib import Path

import pytest

SOAK = Path(__file__).parents[1] / "bench" / "soak_links.py"


@pytest.mark.slow
@pytest.mark.parametrize("minutes", [0.05, pytest.param(10.0, marks=pytest.mark.nightly(minutes=10))])
def test_pages_over_a_bad_link_are_accounted_for(minutes: float) -> None:
    command = [sys.executable, SOAK, "--minutes", str(minutes)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300 + 120 * minutes)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "are accounted for" in done.stdout
