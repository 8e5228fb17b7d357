"""The default run of verbs that take one: the newest in runs/, whose name is printed."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.errors import TraceError

if TYPE_CHECKING:
    from snr_sim.recording.reader import Trace


def run_or_newest(run: Path | None) -> Path:
    """Return the run, or the newest one in runs/ if none is given.

    Raises:
        TraceError: no run is given, and runs/ has none.
    """
    return run if run is not None else _newest_but([])


def trace_of(run: Path | None) -> Trace:
    """Return the trace of a run, or of the newest one in runs/ if none is given.

    Raises:
        TraceError: there is no run, or its trace cannot be read.
    """
    from snr_sim.recording.folder import trace_path
    from snr_sim.recording.reader import read_trace

    return read_trace(trace_path(run_or_newest(run)))


def two_runs(first: Path | None, second: Path | None) -> tuple[Path, Path]:
    """Return two runs; those not given are the newest ones in runs/, the older one first.

    Raises:
        TraceError: there are not enough runs.
    """
    if first is not None:
        return first, second if second is not None else _newest_but([first])
    newest = _newest_but([])
    return _newest_but([newest]), newest


def _newest_but(taken: list[Path]) -> Path:
    from snr_sim.recording.folder import runs_here

    folders = {one.resolve() for one in taken} | {one.resolve().parent for one in taken if one.is_file()}
    run = next((one for one in reversed(runs_here()) if one.resolve() not in folders), None)
    if run is None:
        raise TraceError(
            f"No run was named, and there is {'no other' if taken else 'none'} in runs/.",
            fix="make one: snr run lander_vertical.",
        )
    print_line(sys.stderr, f"the newest run{' but that' if taken else ''}: {run}")
    return run
