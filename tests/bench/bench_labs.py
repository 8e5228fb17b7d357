"""Labs: how long `snr check` keeps a student waiting, with a solution that has all points; wall time, a process each.

Run by `snr bench labs`.
"""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from harness import Row

from snr_sim.scenario.library import list_available

PROJECT = Path(__file__).resolve().parents[2]
LIMIT_S = 20.0
QUICK = ("moving_average", "lunar_lander_q")


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield a row per lab."""
    for lab in list_available("assignments"):
        name = lab.name
        short = name.partition("_")[2]
        if is_quick and short not in QUICK:
            continue
        with tempfile.TemporaryDirectory() as folder:
            mine = Path(folder) / short
            shutil.copytree(lab.path / "starter", mine)
            shutil.copytree(PROJECT / "tests" / "assignments" / short / "reference", mine, dirs_exist_ok=True)
            before_s, start_s = of_children_s(), time.perf_counter()
            command = [sys.executable, "-m", "snr_sim", "check", name, str(mine)]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
            took_s = time.perf_counter() - start_s
        assert done.returncode == 0, done.stdout + done.stderr
        yield Row(f"snr check {name}", took_s, "s", limit=LIMIT_S, note=f"CPU time {of_children_s() - before_s:.1f} s")


def of_children_s() -> float:
    """Return the CPU time of all processes that were waited for [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
