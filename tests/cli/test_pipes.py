"""Answers into a pipe that nobody reads to the end."""

from __future__ import annotations

import subprocess
import sys


def test_a_reader_that_leaves_early_is_no_error() -> None:
    command = [sys.executable, "-m", "snr_sim", "list"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()  # before the first line comes
        assert process.stderr.read() == b""
    assert process.returncode == 0
