"""`snr machine diff OLD NEW`: which states, transitions and variables differ between two programs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from snr_sim.cli.output import print_json, print_text

if TYPE_CHECKING:
    from snr_sim.behaviors.program import Program


def diff(old: Program, new: Program, file: str, *, as_json: bool) -> None:
    """Print the differences; exit with status 1 if there are any.

    Args:
        old, new: the programs.
        file: of the new one.
        as_json: whether to print JSON.
    """
    from snr_sim.behaviors.diff import differences

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
