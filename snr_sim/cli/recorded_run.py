"""Running a scenario and recording it into a new run folder: for `snr run` and `snr resim`."""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from snr_sim.cli.output import guarded, print_note

if TYPE_CHECKING:
    from snr_sim.console.command_receiver import CommandReceiverFactory
    from snr_sim.core.config import Config
    from snr_sim.prelude.plant import Plant
    from snr_sim.recording.records import Header
    from snr_sim.recording.trace import TraceWriter
    from snr_sim.scenario.flight import Flight, Result
    from snr_sim.scenario.role_run import RoleRun, World
    from snr_sim.scenario.simulation import Request, Simulation

QUIET_STALL_LIMIT_S = 60.0  # with --json, where no user reads the warning about a stalled run
SLOW_S = 2.0  # wall time after which a fast run shows its progress
Shown = Literal["", "window", "browser"]  # where a run is shown


def record_run(
    request: Request,
    out: Path,
    pace: float | None,
    *,
    is_viewed: bool,
    live: Shown,
    is_quiet: bool,
    is_watched: bool = False,
    console_port: int | None = None,
    stall_limit_s: float | None = None,
) -> tuple[dict[str, Any], int]:
    """Run a request into a new run folder; return the content of result.json and the exit status.

    Args:
        stall_limit_s: ends a run that stands still for so long; if None, one that is quiet, as a program waits for it.

    Raises:
        SnrError: the request is wrong; nothing has been written.
    """
    from snr_sim.cli.progress import progress
    from snr_sim.core.interrupts import orderly
    from snr_sim.core.reload.watch import watched
    from snr_sim.core.runners import show_log
    from snr_sim.recording.folder import discard, new_run_folder
    from snr_sim.recording.trace import FILE_NAME, TraceWriter
    from snr_sim.scenario.flight import Flight
    from snr_sim.scenario.library import keeping
    from snr_sim.scenario.role_run import RoleRun
    from snr_sim.scenario.source_checks import notes_before

    place, out = out, out.resolve()  # the student's code may change the current folder
    with guarded(is_quiet), ExitStack() as stack:
        simulation, world, plant, config, pace = _prepared(request, pace)
        header = simulation.header(plant, config, "sim" if world is None else "wall")
        config.stall_limit_s = _stall_limit_s(stall_limit_s, is_quiet)
        start_lines = simulation.start_lines()
        if is_watched:
            show_log(logging.INFO)
            config = watched(config)
        if world is not None:  # under one clock the roles' links use memory instead of ports
            stack.callback(world.release)
            world.claim()
        if console_port is not None:
            console = _console(console_port)
            stack.callback(console.release)
            console.claim()
            config.get(simulation.roles[0]).append(console)
        with ExitStack() as undo:  # an invalid request should not leave files behind
            folder = new_run_folder(out, simulation.scenario_name, request.seed)
            undo.callback(discard, folder)
            recorder = TraceWriter(folder / FILE_NAME, header, simulation.opening())
            undo.callback(_close, recorder)
            kept = stack.enter_context(keeping(folder, simulation.files().values()))
            if live:
                stack.enter_context(_live_view(header, recorder, live))
            tick = stack.enter_context(progress(simulation.scenario_name, 0.0 if pace is not None else SLOW_S))
            flight: Flight | RoleRun
            if world is not None:
                flight = RoleRun(world, config, recorder)
            else:
                assert plant is not None  # only a role that runs by itself may be without one
                flight = Flight(simulation, plant, config, recorder, pace, tick)
            if world is not None or simulation.has_wires:  # a real robot continues without its recording
                recorder.fail_softly(flight.nodes)
            # From here on a signal ends the run in order and the files are completed, even if it arrives after the run.
            signals = stack.enter_context(orderly(flight.nodes))
            foreseen = notes_before(simulation, flight.nodes) if isinstance(flight, Flight) else []
            undo.pop_all()
        for line in [] if is_quiet else start_lines:
            print(line, flush=True)
        for line in [] if world is None else world.start_lines():
            print(line, file=sys.stderr, flush=True)
        for note in foreseen:
            print_note(note)
        result = _run_to_end(flight, signals, recorder)
        result.notes = list(dict.fromkeys([*foreseen, *result.notes, *kept.left_out]))
        fields = result_fields(simulation.request, result, recorder.digest, place / folder.name)
        noted = list(result.notes)
        _keep_result(folder, fields, result)
    if is_viewed:
        _write_view(folder, result)
        if fields["notes"] != noted:
            _keep_result(folder, fields, result)
    _say(fields, result, is_quiet, told=foreseen)
    return fields, 0 if result.success else 1


def _prepared(
    request: Request, pace: float | None
) -> tuple[Simulation, World | None, Plant | None, Config, float | None]:
    """Return the simulation, the world of a role that runs by itself, plant, configuration and pace.

    Raises:
        SnrError: the request is invalid.
    """
    from snr_sim.prelude.errors import ParameterError
    from snr_sim.scenario.role_run import World
    from snr_sim.scenario.simulation import prepare

    simulation = prepare(request)
    if simulation.has_wires and pace not in (None, 1.0):
        raise ParameterError(f"With --io {request.io} devices are real, and so is time.", fix="--speed real.")
    pace = 1.0 if simulation.has_wires else pace
    simulation.check_wires()
    if not simulation.is_apart:
        plant = simulation.plant()
        config = simulation.config(plant)
        return simulation, None, plant, config, _pace_with_hands(config, simulation.roles, pace)
    world = World(simulation)
    if pace not in (None, 1.0):
        raise ParameterError(
            f"The role '{world.role}' runs by itself, on the wall clock, at no other speed.", fix="--speed real."
        )
    return simulation, world, world.plant, world.config, pace


def _run_to_end(flight: Flight | RoleRun, signals: list[str], recorder: TraceWriter) -> Result:
    """Run, and close the trace whatever happens; a trace that could not be written is an error of the run."""
    try:
        result = flight.run(signals)
    finally:
        recorder_error = _close(recorder)
    if recorder.loss and not recorder_error:
        result.notes.append(recorder.loss)
    if recorder_error and not result.error:
        result.error, result.outcome, result.success = recorder_error, "error", False
    return result


def _stall_limit_s(asked_s: float | None, is_quiet: bool) -> float:
    """Return how long a run may stall [s].

    Raises:
        ParameterError: the time is not valid.
    """
    if asked_s is None:
        return QUIET_STALL_LIMIT_S if is_quiet else math.inf
    if asked_s > 0:
        return asked_s
    from snr_sim.prelude.errors import ParameterError

    raise ParameterError(f"--stall-limit {asked_s:g} is no time.", fix="seconds above 0, such as 60; or inf.")


def _pace_with_hands(config: Config, roles: list[str], pace: float | None) -> float | None:
    """Return the pace; if a person steers and gave no pace, that of the wall clock, with a note."""
    from snr_sim.devices.pad import PadLoopFactory

    has_hands = any(isinstance(factory, PadLoopFactory) for role in roles for factory in config.get(role))
    if pace is not None or not has_hands:
        return pace
    print("A person steers, so this run takes as long as it says, as with --speed real.", file=sys.stderr)
    return 1.0


def _keep_result(folder: Path, fields: dict[str, Any], result: Result) -> None:
    """Write result.json; if the disk is full the run still counts, with a note."""
    from snr_sim.prelude.errors import TraceError
    from snr_sim.recording.folder import write_result

    try:
        write_result(folder, fields)
    except TraceError as error:
        note = f"{error.message} Try: {error.fix}"
        if note not in result.notes:
            result.notes.append(note)


def _console(port: int) -> CommandReceiverFactory:
    from snr_sim.console.command_receiver import CommandReceiverFactory

    return CommandReceiverFactory(port)


def _close(recorder: TraceWriter) -> str:
    from snr_sim.prelude.errors import TraceError

    try:
        recorder.close()
    except TraceError as error:
        return str(error)
    return ""


def result_fields(request: Request, result: Result, digest: str, folder: Path) -> dict[str, Any]:
    """Return the fields of result.json and --json."""
    fields: dict[str, Any] = {
        "scenario": request.scenario,
        "seed": request.seed,
        "engine": request.engine,
        "controller": request.controller,
        "success": result.success,
        "outcome": result.outcome,
        **result.metrics,
        "sim_time_s": result.sim_time_s,
        "wall_time_s": result.wall_time_s,
        "tasks": result.tasks,
        "pages": result.pages,
        "notes": result.notes,
        "trace_digest": digest,
        "run_dir": str(folder),
    }
    if result.error:
        fields["error"] = result.error
    if result.signal:
        fields["signal"] = result.signal
    return fields


def _write_view(folder: Path, result: Result) -> None:
    """Write view.rrd from the trace; if the viewer's package is missing or the disk is full, the run still counts."""
    if result.signal:
        result.notes.append("No view.rrd was written, as the run was to end at once; snr view makes it.")
        return
    from snr_sim.prelude.errors import MissingExtra, SnrError

    try:
        from snr_sim.view.view import view_of

        view_of(folder)
    except MissingExtra as error:
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
        recorder.follow(live)
        yield


def _say(fields: dict[str, Any], result: Result, is_quiet: bool, told: list[str]) -> None:
    for note in [note for note in result.notes if note not in told]:
        print_note(note)
    if result.error:
        print(result.error, file=sys.stderr)
    if is_quiet:
        return
    speed = result.sim_time_s / result.wall_time_s if result.wall_time_s > 0 else 0.0
    print(
        f"{fields['scenario']}, seed {fields['seed']}, controller {Path(str(fields['controller'])).name}: "
        f"{fields['outcome']} after {result.sim_time_s:.1f} s ({speed:.0f} x real time)"
    )
    is_measured = not (result.error and result.sim_time_s == 0.0)  # else the run did not begin
    for name, value in result.metrics.items() if is_measured else ():
        print(f"  {name:<16} {_in_words(value)}")
    print(f"run folder: {fields['run_dir']}")
    if result.error:
        print(f"  the trace is whole up to there: snr trace {fields['run_dir']}")
    else:
        print(f"  look at it: snr view {fields['run_dir']}    check it: snr replay {fields['run_dir']} --check")


def _in_words(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_in_words(item)}" for key, item in value.items())
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "not reached"  # null in result.json
    return f"{value:.3f}" if isinstance(value, float) else str(value)
