"""`snr health FOLDER`: what each supervised process of a robot does, by the `health.json` of its supervisor."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from snr_sim.cli.arguments import AsJson
from snr_sim.cli.output import print_json, print_note, print_text
from snr_sim.supervision.health import health_table, read_health


def health(
    folder: Annotated[Path, typer.Argument(help="The `folder` of a SupervisedRunner.")],
    as_json: AsJson = False,
) -> None:
    """Print what each supervised process of a robot does.

    Exit status 0: all that is to run is running; 1: it is not; 2: the folder has no health.json.
    """
    found = read_health(folder)
    is_supervised = _is_process(found.supervisor_pid)
    if as_json:
        import msgspec

        print_json({**msgspec.to_builtins(found), "is_supervised": is_supervised})
    else:
        print_text(health_table(found))
        if not is_supervised:
            print_note(
                f"the supervisor, process {found.supervisor_pid}, does not run any more: this is its last state."
            )
    raise typer.Exit(0 if is_supervised and found.tree[0].state == "running" else 1)


def _is_process(pid: int) -> bool:
    """Return whether a process of this computer has that id now; another one may have got it since."""
    if os.name != "posix":  # roles have no processes there, and signal 0 is Ctrl-C
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # of another user
        return True
    return True
