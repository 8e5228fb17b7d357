"""`snr view RUN`: shows a run in rerun, or draws it as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from snr_sim.cli.newest import run_or_newest, trace_of
from snr_sim.cli.output import print_text, print_warnings
from snr_sim.prelude.errors import TraceError


def view(
    run: Annotated[
        Path | None, typer.Argument(help="A run folder, or an .rrd file of one; the newest in runs/ if not given.")
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="In a browser, served on this machine only.")] = False,
    png: Annotated[str, typer.Option(help="Draw a picture into this file instead.")] = "",
) -> None:
    """Show a run in rerun.

    In a window of its own, in a browser with --web, or as a picture with --png FILE.
    """
    run = run_or_newest(run)
    if png:
        _draw(run, Path(png))
        return
    from snr_sim.view.view import view_of
    from snr_sim.view.view_server import check_display, open_view

    if not web and run.exists():
        # Before the view is written, which takes longer than a short run.
        check_display("snr view", f"snr view {run} --web")
    open_view(view_of(run), web)


def _draw(run: Path, png: Path) -> None:
    from snr_sim.recording.folder import outcome_reason, read_result, scenario_metrics
    from snr_sim.recording.records import TruthRecord
    from snr_sim.view.picture import draw_run

    if run.suffix == ".rrd" and run.is_file():
        raise TraceError(
            f"{run} is for the rerun viewer; a picture is drawn from a trace.",
            fix=f"snr view {run.parent} --png {png} draws the recorded run, and snr view {run} shows this one.",
        )
    trace = trace_of(run)
    if not any(isinstance(record, TruthRecord) for record in trace.records):
        raise TraceError(
            f"{run} contains no true states of a body to draw: only simulated runs do.",
            fix=f"snr view {run} shows its pages as plots.",
        )
    print_warnings(trace)
    try:
        result = read_result(trace.path.parent)
        outcome, success = result.get("outcome", ""), result.get("success")
        draw_run(
            trace.header,
            trace.records,
            png,
            outcome,
            result.get("touchdown"),
            success,
            scenario_metrics(result),
            outcome_reason(result),
        )
    except OSError as error:
        raise TraceError(f"The picture {png} cannot be written: {error.strerror}.", fix="name another file.") from error
    print_text(png)
