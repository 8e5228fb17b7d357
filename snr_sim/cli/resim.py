"""`snr resim RUN`: the closed loop again: same scenario, same seed, the plant run anew."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer


def resim(
    run: Annotated[Path, typer.Argument(help="A run folder, or its trace.")],
    with_file: Annotated[str, typer.Option("--with", help="Another controller: a name, or a file.")] = "",
    out: Annotated[Path, typer.Option(help="Folder that run folders go into.")] = Path("runs"),
    no_rrd: Annotated[bool, typer.Option("--no-rrd", help="Leave out view.rrd.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Simulate a run again, plant and all.

    Same scenario and seed, the code as it is now, into a new run folder.

    Exit status: as of `snr run`.
    """
    from snr_sim.cli.run import record_run
    from snr_sim.recording.folder import remarks, trace_path
    from snr_sim.recording.reader import read_trace
    from snr_sim.simulation import request_of

    trace = read_trace(trace_path(run))
    for remark in remarks(trace):
        print(f"note: {remark}", file=sys.stderr)
    request = request_of(trace.opening, trace.header, with_file)
    fields, status = record_run(request, out, None, is_viewed=not no_rrd, is_live=False, is_quiet=as_json)
    fields["resim_of"] = str(trace.path.parent)
    fields["identical"] = fields["trace_digest"] == trace.digest
    if as_json:
        from snr_sim.recording.folder import as_json as json_of

        print(json_of(fields))
    else:
        same = "the same digest as" if fields["identical"] else "another digest than"
        print(f"  {same} {trace.path.parent}")
    sys.exit(status)
