"""`snr resim RUN`: the closed loop again: same scenario, same seed, the plant run anew."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from snr_sim.cli.trust import Trust

if TYPE_CHECKING:
    from snr_sim.scenario.simulation import Request


def resim(
    run: Annotated[
        Path | None, typer.Argument(help="A run folder, or its trace; the newest in runs/ if not given.")
    ] = None,
    with_file: Annotated[str, typer.Option("--with", help="Another controller: a name, or a file.")] = "",
    io: Annotated[
        str, typer.Option(help="Where devices are: sim, emulated, ...; as recorded if not given and nothing real.")
    ] = "",
    out: Annotated[Path, typer.Option(help="Folder that run folders go into.")] = Path("runs"),
    trust: Trust = False,
    rrd: Annotated[bool, typer.Option("--rrd/--no-rrd", help="Write view.rrd at once, not at snr view.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Simulate a run again, plant and all.

    Same scenario and seed, the code as it is now, into a new run folder. A run with real outputs moves nothing again
    unless you say --io.

    Exit status: as of `snr run`.
    """
    from snr_sim.cli.newest import run_or_newest
    from snr_sim.cli.replay import environment_note
    from snr_sim.cli.run import record_run
    from snr_sim.cli.trust import ask
    from snr_sim.recording.folder import records_digest, remarks, trace_path
    from snr_sim.recording.reader import read_trace
    from snr_sim.scenario.replay_files import files_of_resim
    from snr_sim.scenario.simulation import request_of

    trace = read_trace(trace_path(run_or_newest(run)))
    ask(trace.path.parent, files_of_resim(trace, with_file), trust)
    for remark in remarks(trace):
        print(f"note: {remark}", file=sys.stderr)
    request = with_devices(request_of(trace.opening, trace.header, with_file), io)
    fields, status = record_run(request, out, None, is_viewed=rrd, live="", is_quiet=as_json)
    fields["resim_of"] = str(trace.path.parent)
    fields["identical"] = fields["trace_digest"] == trace.digest
    if not fields["identical"]:
        for note in environment_note(trace):
            print(f"note: {note}", file=sys.stderr)
    if as_json:
        from snr_sim.recording.folder import as_json as json_of

        print(json_of(fields))
    else:
        same = "the same digest as"
        if not fields["identical"]:
            new = trace_path(Path(fields["run_dir"]))
            is_same = records_digest(new) == records_digest(trace.path)
            same = "the same records, with another header, as" if is_same else "another digest than"
        print(f"  {same} {trace.path.parent}")
    sys.exit(status)


def with_devices(request: Request, io: str) -> Request:
    """Returns a recorded request with the devices that were asked for, or those it had, if none of them is real.

    Raises:
        ParameterError: nobody has asked for any, and it had real ones: they would move by themselves.
    """
    from snr_sim.prelude.errors import ParameterError
    from snr_sim.prelude.io import parse_io

    if io:
        is_whole = parse_io(request.io).kind == "pi" and parse_io(io).kind != "pi"
        # With --io pi each role ran by itself because it had to; in simulation it needs the others.
        return replace(request, io=io, role=None if is_whole else request.role)
    if parse_io(request.io).has_wires:
        raise ParameterError(
            f"This run was recorded with --io {request.io}: real outputs, which would move again.",
            fix=f"simulate it with --io sim; if they shall move: --io {request.io}.",
        )
    return request
