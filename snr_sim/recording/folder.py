"""Run folders: one per run, never two runs in one, and how a replay finds what it needs in it."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any

from snr_sim.prelude.errors import TraceError
from snr_sim.recording.trace import FILE_NAME

RESULT_NAME = "result.json"
VIEW_NAME = "view.rrd"


def new_run_folder(out: Path, scenario: str, seed: int) -> Path:
    """Makes `<out>/<scenario>-<seed>-<stamp>` and returns it.

    Raises:
        TraceError: it cannot be made.
    """
    stamp = time.strftime("%Y%m%d-%H%M%S")
    for attempt in range(1000):
        folder = out / (f"{scenario}-{seed}-{stamp}" + (f"-{attempt + 1}" if attempt else ""))
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            if out.exists() and not out.is_dir():
                raise TraceError(f"{out} is a file, not a folder.", fix="name a folder with --out.") from None
            continue
        except OSError as error:
            raise TraceError(
                f"The run folder {folder} cannot be made: {error.strerror}.", fix="name another folder with --out."
            ) from error
        return folder
    raise TraceError(f"{out} holds a thousand runs of this second.", fix="name another folder with --out.")


def write_result(folder: Path, fields: dict[str, Any]) -> None:
    """Writes result.json; it is whole or absent."""
    part = folder / (RESULT_NAME + ".part")
    try:
        part.write_text(json.dumps(fields, indent=2) + "\n")
        os.replace(part, folder / RESULT_NAME)
    except OSError:
        part.unlink(missing_ok=True)  # a full disk: the trace says the same


def trace_path(run: Path) -> Path:
    """Returns the trace of a run, given its folder or the trace itself.

    Raises:
        TraceError: there is none; names the runs nearby.
    """
    path = run / FILE_NAME if run.is_dir() else run
    if path.is_file():
        return path
    near = sorted(run.glob(f"*/{FILE_NAME}")) if run.is_dir() else sorted(Path("runs").glob(f"*/{FILE_NAME}"))
    fix = f"the newest run here is {near[-1].parent}." if near else "a run folder is what `snr run` made, under runs/."
    raise TraceError(f"There is no run at {run}.", fix=fix)
