"""Running a scenario and recording it into a new run folder: for `snr run` and `snr resim`."""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

from snr_sim.cli.arguments import Shown
from snr_sim.cli.live_page import LivePage, add_live_page, print_address
from snr_sim.cli.output import capture_output, print_note, print_text
from snr_sim.cli.plain_console import progress
from snr_sim.core.config import Config
from snr_sim.core.interrupts import graceful_shutdown
from snr_sim.core.reload.watch import with_watch
from snr_sim.core.runners import show_log
from snr_sim.core.standard_streams import print_line
from snr_sim.core.standstill import SlowStart
from snr_sim.devices.gamepad import GamepadLoopFactory
from snr_sim.prelude.errors import MissingExtraError, ParameterError, SnrError, TraceError
from snr_sim.prelude.plant import Plant
from snr_sim.recording.folder import discard, new_run_folder, write_result
from snr_sim.recording.records import Header
from snr_sim.recording.sources import keep_copies
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.library import is_own
from snr_sim.scenario.reload_checks import ReloadChecks
from snr_sim.scenario.role_run import RoleRun
from snr_sim.scenario.simulation import Request, Simulation, prepare
from snr_sim.scenario.simulation_run import RunResult, SimulationRun
from snr_sim.scenario.source_checks import notes_before

_JSON_STALL_LIMIT_S = 60.0  # with --json, where no user reads the warning about a stalled run
_SLOW_S = 2.0  # wall time after which a fast run shows its progress


def record_run(
    request: Request,
    out: Path,
    pace: float | None,
    *,
    is_viewed: bool,
    live: Shown,
    is_json: bool,
    is_watched: bool = False,
    console_port: int | None = None,
    page: LivePage | None = None,
    stall_limit_s: float | None = None,
    guard_s: float | None = None,
) -> tuple[dict[str, Any], int]:
    """Run a request into a new run folder; return the content of result.json and the exit status.

    Args:
        page: the live page of its state machines, if there is to be one.
        stall_limit_s: ends a run that stands still for so long; if None, one that is quiet, as a program waits for it.
        guard_s: how long after an edit of a machine a failure puts the program before it back; None: never.

    Raises:
        SnrError: the request is wrong; nothing has been written.
    """
    place, out = out, out.resolve()  # the student's code may change the current folder
    with capture_output(is_json), ExitStack() as stack:
        start = stack.enter_context(ExitStack())
        start.enter_context(SlowStart())
        simulation, alone, plant, config, pace = _prepared(request, pace)
        header = simulation.header(plant, config, "sim" if alone is None else "wall")
        config.stall_limit_s = _stall_limit_s(stall_limit_s, is_json)
        if guard_s is not None:
            from snr_sim.scenario.machine_controller import guard_edits

            guard_edits(config, guard_s)
        start_lines = simulation.start_lines()
        if is_watched:
            show_log(logging.INFO)
            config = with_watch(config)
        if alone is not None:  # under one clock the roles' links use memory instead of ports
            stack.callback(alone.release)
            alone.claim()
        if console_port is not None:
            from snr_sim.console.command_receiver import CommandReceiverFactory

            console = CommandReceiverFactory(console_port)
            stack.callback(console.release)
            console.claim()
            config.get(simulation.roles[0]).append(console)
        live_page = None
        if page is not None:
            title = f"{simulation.scenario_name}, seed {request.seed}"
            live_page = add_live_page(config, simulation.roles, page, title)
            stack.callback(live_page.release)
            live_page.claim()
        with ExitStack() as undo:  # an invalid request should not leave files behind
            folder = new_run_folder(out, simulation.scenario_name, request.seed)
            undo.callback(discard, folder)
            if live_page is not None:
                live_page.folder = folder
            recorder = TraceWriter(folder / FILE_NAME, header, simulation.trace_info())
            undo.callback(_close, recorder)
            kept = stack.enter_context(keep_copies(folder, simulation.files().values(), is_own))
            if live:
                stack.enter_context(_live_view(header, recorder, live))
            tick = stack.enter_context(progress(simulation.scenario_name, 0.0 if pace is not None else _SLOW_S))
            run: SimulationRun | RoleRun
            if alone is not None:
                alone.begin(config, recorder)
                run = alone
            else:
                assert plant is not None  # only a role that runs by itself may be without one
                run = SimulationRun(simulation, plant, config, recorder, pace, tick)
            if alone is not None or simulation.is_real_time:  # a real robot continues without its recording
                recorder.fail_softly(run.nodes)
            # From here on a signal ends the run in order and the files are completed, even if it arrives after the run.
            signals = stack.enter_context(graceful_shutdown(run.nodes))
            foreseen = notes_before(simulation, run.nodes) if isinstance(run, SimulationRun) else []
            undo.pop_all()
        start.close()
        for line in [] if is_json else start_lines:
            print_line(sys.stdout, line)
        if live_page is not None:
            print_address(live_page)
        for line in [] if alone is None else alone.start_lines():
            print_line(sys.stderr, line)
        for note in foreseen:
            print_note(note)
        if is_watched and isinstance(run, SimulationRun):

            def report(note: str) -> None:
                foreseen.append(note)
                print_note(note)

            ReloadChecks(simulation, run.nodes, foreseen, report)
        result = _run_to_end(run, signals, recorder)
        result.notes = list(dict.fromkeys([*foreseen, *result.notes, *kept.left_out]))
        fields = result.fields(simulation.request, recorder.digest, place / folder.name)
        noted = list(result.notes)
        _keep_result(folder, fields, result)
    if is_viewed:
        _write_view(folder, result)
        if fields["notes"] != noted:
            _keep_result(folder, fields, result)
    _print_result(fields, result, is_json, printed=foreseen)
    return fields, 0 if result.success else 1


def _prepared(
    request: Request, pace: float | None
) -> tuple[Simulation, RoleRun | None, Plant | None, Config, float | None]:
    """Return the simulation, the run of a role that runs by itself, plant, configuration and pace."""
    simulation = prepare(request)
    if simulation.is_real_time and pace not in (None, 1.0):
        raise ParameterError(f"--io {request.io} has devices that run in real time only.", fix="--speed real.")
    pace = 1.0 if simulation.is_real_time else pace
    simulation.check_hardware()
    if not simulation.is_standalone:
        plant = simulation.plant()
        config = simulation.config(plant)
        return simulation, None, plant, config, _pace_for_manual_pilot(config, simulation.roles, pace)
    alone = RoleRun(simulation)
    if pace not in (None, 1.0):
        raise ParameterError(f"The role '{alone.role}' runs alone, in real time only.", fix="--speed real.")
    return simulation, alone, alone.plant, alone.config, pace


def _run_to_end(run: SimulationRun | RoleRun, signals: list[str], recorder: TraceWriter) -> RunResult:
    """Run, and close the trace whatever happens; a trace that could not be written is an error of the run."""
    try:
        result = run.run(signals)
    finally:
        recorder_error = _close(recorder)
    if recorder.loss and not recorder_error:
        result.notes.append(recorder.loss)
    if recorder_error and not result.error:
        result.error, result.outcome, result.success = recorder_error, "error", False
    return result


def _stall_limit_s(asked_s: float | None, is_json: bool) -> float:
    """Return how long a run may stall [s]; raise ParameterError for an invalid time."""
    if asked_s is None:
        return _JSON_STALL_LIMIT_S if is_json else math.inf
    if asked_s > 0:
        return asked_s
    raise ParameterError(
        f"--stall-limit must be greater than 0, not {asked_s:g}.", fix="give seconds, such as 60, or inf."
    )


def _pace_for_manual_pilot(config: Config, roles: list[str], pace: float | None) -> float | None:
    """Return the pace; if a person steers and gave no pace, that of the wall clock, with a note."""
    is_manual = any(isinstance(factory, GamepadLoopFactory) for role in roles for factory in config.get(role))
    if pace is not None or not is_manual:
        return pace
    print_line(sys.stderr, "A person steers, so this run takes as long as it says, as with --speed real.")
    return 1.0


def _keep_result(folder: Path, fields: dict[str, Any], result: RunResult) -> None:
    """Write result.json; if the disk is full the run still counts, with a note."""
    try:
        write_result(folder, fields)
    except TraceError as error:
        note = f"{error.message} Try: {error.fix}"
        if note not in result.notes:
            result.notes.append(note)


def _close(recorder: TraceWriter) -> str:
    try:
        recorder.close()
    except TraceError as error:
        return str(error)
    return ""


def _write_view(folder: Path, result: RunResult) -> None:
    """Write view.rrd from the trace; if the viewer's package is missing or the disk is full, the run still counts."""
    if result.signal:
        result.notes.append("No view.rrd was written, as the run was to end at once; snr view makes it.")
        return
    try:
        from snr_sim.view.view import view_of

        view_of(folder)
    except MissingExtraError as error:
        result.notes.append(f"No view.rrd was written. {error.message} {error.fix}")
    except (OSError, SnrError) as error:
        result.notes.append(f"No view.rrd was written: {error}")
    except KeyboardInterrupt:
        result.notes.append("No view.rrd was written, as it was interrupted; snr view makes it.")


@contextmanager
def _live_view(header: Header, recorder: TraceWriter, shown: Shown) -> Iterator[None]:
    """Show the run while it is recorded, in a window that stays open afterwards, or in the browser."""
    from snr_sim.view.view import LiveView
    from snr_sim.view.view_server import live_window, serve_web

    live = LiveView(header)
    with closing(live), ExitStack() as stack:
        if shown == "window":
            stack.enter_context(live_window(live.url, print_note))
        else:
            url = stack.enter_context(serve_web(live.url))
            print_note(
                f"open {url}\n  Only this computer can reach it, as long as the run goes; a page that is open stays."
            )
        recorder.add_listener(live)
        yield


def _print_result(fields: dict[str, Any], result: RunResult, is_json: bool, printed: list[str]) -> None:
    for note in [note for note in result.notes if note not in printed]:
        print_note(note)
    if result.error:
        print_line(sys.stderr, result.error)
    if is_json:
        return
    speed = result.sim_time_s / result.wall_time_s if result.wall_time_s > 0 else 0.0
    print_text(
        f"{fields['scenario']}, seed {fields['seed']}, controller {Path(str(fields['controller'])).name}: "
        f"{fields['outcome']} after {result.sim_time_s:.1f} s ({speed:.0f} x real time)"
    )
    is_measured = not (result.error and result.sim_time_s == 0.0)  # else the run did not begin
    for name, value in result.metrics.items() if is_measured else ():
        print_text(f"  {name:<16} {_format_metric(value)}")
    print_text(f"run folder: {fields['run_dir']}")
    if result.error:
        print_text(f"  the trace is whole up to there: snr trace {fields['run_dir']}")
    else:
        print_text(f"  look at it: snr view {fields['run_dir']}    check it: snr replay {fields['run_dir']} --check")


def _format_metric(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_format_metric(item)}" for key, item in value.items())
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "not reached"  # null in result.json
    return f"{value:.3f}" if isinstance(value, float) else str(value)
