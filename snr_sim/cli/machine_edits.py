"""`snr machine edits RUN`: writes the edits of a run as files, and runs it again with them."""

from __future__ import annotations

import sys
from pathlib import Path

import typer

from snr_sim.cli.newest import trace_of
from snr_sim.cli.output import capture_output, print_json, print_text
from snr_sim.cli.trust import ask
from snr_sim.scenario.machine_edits import TABLE, changes_again, edits_of, write
from snr_sim.scenario.replay_files import files_of_resim


def edits(run: Path, out: Path | None, *, trust: bool, as_json: bool) -> None:
    """Write the edits of a run into a folder, `edits` in the run's if None; run it again; print whether it repeats."""
    trace = trace_of(run)
    found = edits_of(trace)
    folder = out or trace.path.parent / "edits"
    write(found, folder)
    first = folder / "0.lrp"
    ask(trace.path.parent, files_of_resim(trace, str(first)), trust)
    with capture_output(is_json=True):
        is_same = changes_again(found, first) == found.changes
    if as_json:
        print_json({"folder": str(folder), "at_s": found.at_s, "identical": is_same, "left_out": found.others})
    else:
        count = len(found.at_s)
        times = f": {', '.join(f'{at_s:g}' for at_s in found.at_s)} s" if count else ""
        print_text(f"{count} {'edit' if count == 1 else 'edits'} of {found.name}{times}")
        print_text(f"written to {folder}: 0.lrp to {count}.lrp, {TABLE}")
        if found.others:
            print_text(f"not written, because only edits of the text are: {', '.join(dict.fromkeys(found.others))}")
        print_text("run again with them: " + ("identical" if is_same else "its states change differently"))
    sys.stdout.flush()
    if not is_same:
        raise typer.Exit(1)
