"""The command line in a notebook: `snr("run", "lander_vertical")` does the same as `snr run lander_vertical`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def snr(*words: object, folder: str | Path = ".") -> int:
    """Run a command as in a terminal, print its output, and return its exit status.

    Args:
        words: of the command, without the leading `snr`.
        folder: its current folder; printed paths are relative to it.
    """
    done = subprocess.run(
        [sys.executable, "-m", "snr_sim", *map(str, words)],
        cwd=folder,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={**os.environ, "NO_COLOR": "1", "COLUMNS": "110"},  # a notebook is not a terminal, but nearly as wide
    )
    print(done.stdout.replace(f"{folder}/", ""), end="")
    return done.returncode
