"""`snr machine diff OLD NEW`: which states, transitions and variables differ between two programs."""

from __future__ import annotations

import typer

from snr_sim.behaviors.diff import differences
from snr_sim.behaviors.program import Program
from snr_sim.cli.output import print_json, print_text


def diff(old: Program, new: Program, file: str, *, as_json: bool) -> None:
    """Print the differences, of which `file` has the new program; exit with status 1 if there are any."""
    found = differences(old, new)
    if as_json:
        print_json({"differences": [one._asdict() for one in found]})
    else:
        for one in found:
            where = f"{one.machine}: " if one.machine not in ("", one.name) else ""
            print_text(f"{file}:{one.line}: {where}{one.what} {one.name} {one.how}")
        print_text(f"{len(found) or 'no'} difference{'' if len(found) == 1 else 's'}")
    if found:
        raise typer.Exit(1)
