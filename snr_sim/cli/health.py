"""`snr health RUN` or `snr health HOST:PORT`: what each supervised process of a robot does."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Annotated

import typer

from snr_sim.cli.arguments import AsJson, address_of
from snr_sim.cli.output import print_json, print_note, print_text
from snr_sim.prelude.errors import ParameterError
from snr_sim.supervision.health import health_table, read_health

_ADDRESS = re.compile(r"\d+|\S+:\d+")


def health(
    where: Annotated[str, typer.Argument(metavar="RUN|HOST:PORT", help="The run folder; or where the robot answers.")],
    wait: Annotated[float, typer.Option(help="Seconds to wait for an answer from HOST:PORT.")] = 3.0,
    as_json: AsJson = False,
) -> None:
    """Print what each supervised process of a robot does.

    Exit status 0: all that is to run is running; 1: it is not; 2: the folder has no health.json, or no answer came.
    """
    if not 0.0 < wait < float("inf"):
        raise ParameterError(f"--wait is {wait:g}.", fix="seconds, such as --wait 3.")
    is_address = _ADDRESS.fullmatch(where) is not None and not Path(where).exists()
    if is_address:
        from snr_sim.supervision.health_link import ask_health

        found, is_supervised = ask_health(address_of(where, "an address"), wait), True
    else:
        found = read_health(Path(where))
        is_supervised = found.supervisor_pid is not None and _is_process(found.supervisor_pid)
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
