"""The default run of verbs that take one: the newest in runs/, whose name is printed."""

from __future__ import annotations

import sys
from pathlib import Path

from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.errors import TraceError
from snr_sim.recording.folder import runs_here, trace_path
from snr_sim.recording.reader import Trace, beginning_of, read_trace


def run_or_newest(run: Path | None) -> Path:
    """Return the run, or the newest one in runs/ if none is given; raise TraceError if there is none."""
    return run if run is not None else _newest_but([])


def trace_of(run: Path | None) -> Trace:
    """Return the trace of a run, or of the newest one in runs/ if none is given; raise TraceError if there is none."""
    return read_trace(trace_path(run_or_newest(run)))


def two_runs(first: Path | None, second: Path | None) -> tuple[Path, Path]:
    """Return two runs; those not given are the newest of one robot in runs/, the older first.

    Raises:
        TraceError: there are too few.
    """
    if first is not None:
        return first, second if second is not None else _newest_but([first])
    newest = _newest_but([])
    return _newest_but([newest]), newest


def _newest_but(taken: list[Path]) -> Path:
    folders = {one.resolve() for one in taken} | {one.resolve().parent for one in taken if one.is_file()}
    left = (one for one in reversed(runs_here()) if one.resolve() not in folders)
    robots = {_robot_of(one) for one in taken} - {""}
    run = next((one for one in left if not robots or _robot_of(one) in robots), None)
    if run is None:
        of = "".join(f" of the robot '{robot}'" for robot in robots)
        raise TraceError(
            f"No run was named, and there is {'no other' if taken else 'none'}{of} in runs/.",
            fix="make one: snr run lander_vertical.",
        )
    print_line(sys.stderr, f"the newest run{' but that' if taken else ''}: {run}")
    return run


def _robot_of(run: Path) -> str:
    """Return the robot of a run, or an empty text if its trace cannot be read."""
    try:
        path = trace_path(run)
        with path.open("rb") as file:
            return beginning_of(path, [file.readline(), file.readline()])[1].robot
    except (OSError, TraceError):
        return ""
