"""The soak of tests/bench in little: a few seconds of the half hour, too few to judge what grows."""

import subprocess
import sys
from pathlib import Path

SOAK = Path(__file__).parents[2] / "bench" / "soak_links.py"


def test_pages_over_a_bad_link_are_accounted_for() -> None:
    done = subprocess.run([sys.executable, SOAK, "--minutes", "0.05"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "are accounted for" in done.stdout
