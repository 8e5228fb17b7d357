"""The command line in a notebook: `snr("run", "lander_vertical")` does the same as `snr run lander_vertical`.

`show_run(RUN)` as the last line of a cell shows a recorded run.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.view.view_notebook import show_run as show_run
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
    __all__.append("snr")


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
    print(done.stdout.replace(f"{folder}/", ""), end="")  # noqa: T201
    return done.returncode
