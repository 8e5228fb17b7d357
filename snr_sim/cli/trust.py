"""Confirmation before a command executes files that may come from another user."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.text import visible

Trust = Annotated[
    bool, typer.Option("--trust", help="Execute the run's files, also those that another user may have written.")
]


def ask(run: object, unknown: Sequence[str], is_trusted: bool) -> None:
    """Ask whether the unknown files of a run may be executed; return if so, or if there are none.

    ParameterError is raised if the user does not agree, or there is no terminal to ask on.
    """
    if is_trusted or not unknown:
        return
    listed = "\n".join(f"  {name}" for name in unknown)
    message = f"{run} was not recorded by you on this computer, as far as is known. It would execute:\n{listed}"
    if sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty():
        if typer.confirm(visible(f"{message}\nExecute them, with all that you may do here?"), err=True):
            return
        raise ParameterError("Nothing was executed.", fix="snr trace and snr view show a run without executing it.")
    raise ParameterError(
        f"{message}\nNothing was executed.", fix="read them; then --trust, or --with FILE for code of your own."
    )
