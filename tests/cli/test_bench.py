"""`snr bench`: it runs and says what it found; how fast, no test can say."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow


def snr_bench(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "snr_sim", "bench", *words], capture_output=True, text=True, check=False
    )


def test_a_quick_run_of_one_file_is_one_json_object_with_machine_and_rows() -> None:
    done = snr_bench("pages", "--quick", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert {"cpu", "cores", "python", "packages", "date"} <= set(found["machine"])
    assert all(row["subject"] == "pages" and row["value"] > 0 for row in found["rows"])
    assert {row["limit"] for row in found["rows"]} == {2.5, 2.0}


def test_an_unknown_benchmark_is_answered_with_the_nearest_name() -> None:
    done = snr_bench("dispach")
    assert done.returncode == 2
    assert "dispatch" in done.stderr
