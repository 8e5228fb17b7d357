"""The text that a user types before anything moves on the bench."""

from __future__ import annotations

import sys

from snr_sim.cli.output import print_text
from snr_sim.prelude.errors import ParameterError


def confirm_motion(warning: str, expected: str) -> None:
    """Ask for a text that a user does not type by accident; raise ParameterError if another was typed."""
    print_text(f"{warning} Type  {expected}  to continue: ", end="", flush=True)
    typed = sys.stdin.readline().strip()
    if typed != expected:
        raise ParameterError(f"Nothing was moved: '{typed}' is not '{expected}'.", fix=f"type: {expected}")
