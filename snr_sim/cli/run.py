"""`snr run SCENARIO`: runs it, records it, and prints the outcome."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from snr_sim.cli.arguments import AsJson, Io, Out, Shown, WithRrd, options_of, pace_of
from snr_sim.cli.live_page import LOOPBACK, LivePage
from snr_sim.cli.output import print_json, print_note
from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.errors import ParameterError, SnrError
from snr_sim.prelude.io import ENVIRONMENT, parse_io


def run(
    context: typer.Context,
    scenario: Annotated[str, typer.Argument(help="A scenario's name, or its file; `snr list scenarios`.")],
    seed: Annotated[int, typer.Option(help="Of all random numbers in the run; each seed is another start.")] = 0,
    engine: Annotated[str, typer.Option(help="Physics engine; the scenario's first if not given.")] = "",
    controller: Annotated[str, typer.Option(help="One of the robot's by name, or a file: ./mine.py.")] = "",
    role: Annotated[str, typer.Option(help="Runs one role only, in real time; start the others too.")] = "",
    io: Io = "",
    speed: Annotated[str, typer.Option(help="'fast', 'real', or a multiple of real time such as 4.")] = "fast",
    option: Annotated[list[str], typer.Option(help="KEY=VALUE, see `snr list robots`; may be repeated.")] = [],  # noqa: B006
    policy: Annotated[
        str, typer.Option(metavar="FILE", help="What it has learned; same as --option policy=FILE.")
    ] = "",
    out: Out = Path("runs"),
    rrd: WithRrd = False,
    show: Annotated[
        bool, typer.Option("--view", help="Show it in rerun: live with --speed, else when it is over.")
    ] = False,
    show_web: Annotated[
        bool, typer.Option("--web-view", help="The same in a browser, served on this machine only.")
    ] = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="Reload a component when its file is saved; with --speed real.")
    ] = False,
    guard: Annotated[
        float | None,
        typer.Option(metavar="S", help="Put the program before an edit in LRP back if the new one fails within S s."),
    ] = None,
    console: Annotated[
        int | None, typer.Option(metavar="PORT", help="For `snr console PORT`, on this machine.")
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="A page in the browser to watch and edit its state machines.")
    ] = False,
    live_port: Annotated[int, typer.Option(metavar="PORT", help="Of --live: not any free port, but this one.")] = 0,
    live_host: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Of --live: another address; needs --live-token-file.")
    ] = LOOPBACK,
    live_token_file: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of --live: a token of your own, at least 16 characters.")
    ] = None,
    as_json: AsJson = False,
    stall_limit: Annotated[
        float | None,
        typer.Option(metavar="S", help="End a run that stands still for S seconds; 60 with --json, else inf."),
    ] = None,
) -> None:
    """Run a scenario and record it.

    Exit status: 0 the scenario's criterion was met, 1 it ran and was not, 2 the request was wrong (nothing written).
    """
    from snr_sim.cli.recorded_run import record_run  # most of a run's modules, which --help need not wait for
    from snr_sim.scenario.simulation import Request

    # A file is stored with its path, so that a replay from another folder finds it again.
    options = options_of([*option, f"policy={Path(policy).resolve()}"] if policy else option)
    request = Request(scenario, seed, engine or None, controller or None, role or None, io, options)
    pace = pace_of(speed)
    if watch and pace is None:
        raise ParameterError(
            "--watch needs --speed: a fast run ends before a file is saved.", fix="--watch --speed real."
        )
    page = LivePage.of_options(live, live_port, live_host, live_token_file)
    if page is not None and pace is None:
        print_note("A fast run may be over before its page is open. Try: --speed real, or snr machine view RUN later.")
    source = context.get_parameter_source("io")
    if source is not None and source.name == "ENVIRONMENT" and parse_io(io).is_hardware:
        print_line(sys.stderr, f"real outputs: {io}, from {ENVIRONMENT}")  # which may have been set days ago
    if show and not show_web:
        from snr_sim.view.view_server import check_display

        check_display("--view", "--web-view")
    shown: Shown = "browser" if show_web else "window" if show else ""
    is_live = bool(shown) and pace is not None  # a fast run is over before a window is open
    fields, status = record_run(
        request,
        out,
        pace,
        is_viewed=rrd,
        live=shown if is_live else "",
        is_json=as_json,
        is_watched=watch,
        console_port=console,
        page=page,
        stall_limit_s=stall_limit,
        guard_s=guard,
    )
    if as_json:
        print_json(fields)
    if shown and not is_live:
        _show(Path(fields["run_dir"]), shown)
    sys.exit(status)


def _show(folder: Path, shown: Shown) -> None:
    """Open the finished run; if that fails, the run still counts."""
    from snr_sim.cli.view import view

    sys.stdout.flush()
    try:
        view(folder, web=shown == "browser")
    except SnrError as error:
        print_note(str(error))
