"""`snr resim RUN`: simulates the closed loop again, with the same scenario and seed and a new plant."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from snr_sim.cli.arguments import AsJson, Out, RecordedRun, WithRrd
from snr_sim.cli.newest import trace_of
from snr_sim.cli.output import print_json, print_note, print_text, print_warnings
from snr_sim.cli.replay import environment_note
from snr_sim.cli.trust import Trust, ask
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.io import parse_io
from snr_sim.recording.folder import records_digest, trace_path
from snr_sim.scenario.replay_files import files_of_resim
from snr_sim.scenario.simulation import Request, request_of


def resim(
    run: RecordedRun = None,
    with_file: Annotated[str, typer.Option("--with", help="Another controller: a name, or a file.")] = "",
    io: Annotated[
        str, typer.Option(help="Where devices are: sim, emulated, ...; as recorded if not given and nothing real.")
    ] = "",
    out: Out = Path("runs"),
    trust: Trust = False,
    rrd: WithRrd = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a run again, plant and all.

    Same scenario and seed, the code as it is now, into a new run folder. A run with real outputs moves nothing again
    unless you say --io.

    Exit status: as of `snr run`.
    """
    from snr_sim.cli.recorded_run import record_run  # most of a run's modules, which --help need not wait for

    trace = trace_of(run)
    ask(trace.path.parent, files_of_resim(trace, with_file), trust)
    print_warnings(trace)
    request = with_devices(request_of(trace.trace_info, trace.header, with_file), io)
    fields, status = record_run(request, out, None, is_viewed=rrd, live="", is_json=as_json)
    fields["resim_of"] = str(trace.path.parent)
    fields["identical"] = fields["trace_digest"] == trace.digest
    if not fields["identical"]:
        for note in environment_note(trace):
            print_note(note)
    if as_json:
        print_json(fields)
    else:
        same = "the same digest as"
        if not fields["identical"]:
            new = trace_path(Path(fields["run_dir"]))
            is_same = records_digest(new) == records_digest(trace.path)
            same = "the same records, with another header, as" if is_same else "another digest than"
        print_text(f"  {same} {trace.path.parent}")
    sys.exit(status)


def with_devices(request: Request, io: str) -> Request:
    """Return a recorded request with the devices asked for, or with its own devices if none of them is real.

    ParameterError is raised if none were asked for and the run had real ones, which would move unexpectedly.
    """
    if io:
        is_whole = parse_io(request.io).kind == "pi" and parse_io(io).kind != "pi"
        # With --io pi each role had to run by itself; in simulation it needs the other roles.
        return replace(request, io=io, role=None if is_whole else request.role)
    if parse_io(request.io).is_hardware:
        raise ParameterError(
            f"This run was recorded with --io {request.io}: real outputs, which would move again.",
            fix=f"simulate it with --io sim, or let them move: --io {request.io}.",
        )
    return request
