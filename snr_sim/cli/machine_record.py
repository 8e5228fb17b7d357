"""`snr machine record RUN`: a piece of a run as a test of its program."""

from __future__ import annotations

import math
import re
from pathlib import Path

import typer

from snr_sim.cli.machine_replay import replaying
from snr_sim.cli.newest import trace_of
from snr_sim.cli.output import print_note, print_text
from snr_sim.cli.replay import config_of_replay
from snr_sim.prelude.errors import ParameterError, SnrError

_TEST = '''"""{title}, printed by `snr machine record`. It is about the program in {file}."""

from snr_sim.scenario import replay_piece

PIECE = r"""
{piece}
"""


def test_{name}_changes_its_states_as_recorded() -> None:
    assert replay_piece(PIECE, {file!r}) == [{changes}]
'''


def record(run: Path, name: str, file: str, from_s: float, until_s: float, *, trust: bool) -> None:
    """Print a test file that runs a program on a piece of a run; exit with status 1 if that test would fail.

    Args:
        run: its folder.
        name: of the machine's component; empty if there is one only.
        file: the program; if empty, that of the run.
        from_s, until_s: the piece.
        trust: whether files of another user may be executed without a question.
    """
    from snr_sim.scenario.library import LRP
    from snr_sim.scenario.machine_edits import edits_of
    from snr_sim.scenario.machine_piece import piece_of, replay_piece

    if not 0.0 <= from_s < until_s < math.inf:
        raise ParameterError(f"The piece is from {from_s:g} s to {until_s:g} s.", fix="--from 10 --until 12.")
    trace = trace_of(run)
    file = file or _shown(Path(trace.trace_info.controller))
    if not (file.endswith(LRP) and Path(file).is_file()):
        raise ParameterError(f"'{file}' is not a file with a program in LRP.", fix="name it: --with mine.lrp.")
    name = name or edits_of(trace).name
    with replaying(trace, trust=trust) as plan:
        config, _ = config_of_replay(trace, plan, "")
        piece, changes = piece_of(trace, config, plan.files.begin_task, name, from_s, until_s)
    rows = "".join(f"\n        {one!r}," for one in changes) + ("\n    " if changes else "")
    title = f"{name} in {trace.path.parent.name}, {from_s:g} s to {until_s:g} s"
    print_text(_TEST.format(title=title, file=file, name=_python_name(name), piece=piece, changes=rows), end="")
    try:
        found = replay_piece(piece, file)
    except SnrError as error:
        problem = str(error)
    else:
        problem = "" if found == changes else f"with {file} as it is today, the states change differently"
    if problem:
        print_note(f"This test fails: {problem}.")
        raise typer.Exit(1)


def _python_name(name: str) -> str:
    return re.sub(r"\W", "_", name.lower())


def _shown(path: Path) -> str:
    """Return a path for the test: relative if it is below the current folder."""
    folder = Path.cwd()
    return str(path.relative_to(folder)) if path.is_relative_to(folder) else str(path)
