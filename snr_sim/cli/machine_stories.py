"""`snr machine try FILE` without a run: random stories, and the shortest one that fails, as a test."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from snr_sim.cli.output import print_json, print_text
from snr_sim.prelude.errors import ParameterError

if TYPE_CHECKING:
    from snr_sim.behaviors.bridge import Bridge
    from snr_sim.behaviors.program import Program

MAX_CASES = 1_000_000


def try_stories(
    program: Program, file: Path, bridge: Bridge | None, cases: int, *, is_strict: bool, as_json: bool
) -> None:
    """Try random stories on a program; exit with status 1 if one fails.

    Args:
        program: to be tried.
        file: that it is in.
        bridge: of its robot, for the limits of what is read.
        cases: how many stories.
        is_strict: whether an exception in a block is a failure.
        as_json: whether to print JSON.
    """
    if not 0 < cases <= MAX_CASES:
        raise ParameterError(f"--cases {cases}: 1 to {MAX_CASES} of them.", fix="--cases 1000.")
    from snr_sim.testing.machines import StoryChoices, as_test, failing_story

    found = failing_story(StoryChoices(program, bridge=bridge, is_strict=is_strict), cases)
    if found is None:
        print_json({"cases": cases, "reason": None}) if as_json else print_text(f"{cases} stories: none fails")
        return
    calls, error = found
    reason = f"{type(error).__name__}: {error}" if not isinstance(error, AssertionError) else str(error)
    text = f"# {reason}\n" + as_test(calls, re.sub(r"\W", "_", file.stem), *_source(program, file), is_strict=is_strict)
    if as_json:
        print_json(
            {"cases": cases, "reason": reason, "story": [[name, *values] for name, values in calls], "test": text}
        )
    else:
        print_text(text, end="")
    raise typer.Exit(1)


def _source(program: Program, file: Path) -> tuple[str, str]:
    """Return the line that a test imports the program by, and what it calls the program."""
    from snr_sim.behaviors.program import Program
    from snr_sim.scenario.library import LRP, load_program

    if file.suffix == LRP:
        return "from pathlib import Path", f'Path(__file__).with_name("{file.name}")'
    named = vars(load_program(str(file))).items()
    name = next(key for key, one in named if isinstance(one, Program) and one.sha256 == program.sha256)
    return f"from {file.stem} import {name}", name
