"""`snr machine diff`: what differs between two programs, or what a changed program changes in a recorded run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from snr_sim.cli.machine_replay import replay_machines
from snr_sim.cli.newest import trace_of
from snr_sim.cli.output import print_json, print_text
from snr_sim.cli.replay import sentence_of, writable

if TYPE_CHECKING:
    from snr_sim.behaviors.diff import Difference
    from snr_sim.behaviors.explain import Evaluations
    from snr_sim.behaviors.program import Program
    from snr_sim.recording.checker import NodeReplay
    from snr_sim.scenario.machine_change import ProgramChange

UNEXPLAINED = 3  # exit status


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
        _print(found, file)
    if found:
        raise typer.Exit(1)


def diff_in_run(run: Path, file: str, *, trust: bool, as_json: bool) -> None:
    """Print what a changed program changes in a run; exit with status 1 if anything, 3 if no change explains it.

    Args:
        run: its folder.
        file: the program.
        trust: whether files of another user may be executed without a question.
        as_json: whether to print JSON.
    """
    from snr_sim.scenario.machine_change import change_of
    from snr_sim.scenario.machine_edits import LINES

    trace = trace_of(run)

    def replay(is_new: bool, evaluations: Callable[[Program], Evaluations]) -> list[NodeReplay]:
        with_file = file if is_new else ""
        return replay_machines(trace, with_file, trust=trust, evaluations=evaluations, tolerances=LINES)

    found = change_of(trace, replay)
    if as_json:
        one = found.divergence
        print_json(
            {
                "differences": [each._asdict() for each in found.differences],
                "first_evaluated": None if found.first is None else {**found.first._asdict(), "t_s": found.first_s},
                "first_divergence": None if one is None else asdict(writable(one)),
                "explained": found.is_explained,
            }
        )
    else:
        _print_change(found, file)
    if found.divergence is not None:
        raise typer.Exit(1 if found.is_explained else UNEXPLAINED)


def _print(found: Sequence[Difference], file: str) -> None:
    for one in found:
        print_text(_line(one, file))
    print_text(f"{len(found) or 'no'} difference{'' if len(found) == 1 else 's'}")


def _line(one: Difference, file: str) -> str:
    where = f"{one.machine}: " if one.machine not in ("", one.name) else ""
    return f"{file}:{one.line}: {where}{one.what} {one.name} {one.how}"


def _print_change(found: ProgramChange, file: str) -> None:
    _print(found.differences, file)
    if found.first is None:
        print_text("none of them is evaluated in this run" if found.differences else "the programs do the same")
    else:
        print_text(f"first evaluated: t = {found.first_s:.4f} s, {_line(found.first, file)}")
    one = found.divergence
    if one is None:
        print_text("the replay is identical")
    else:
        print_text(f"first difference: t = {one.t:.4f} s, seq {one.seq}, {sentence_of(one)}")
    if not found.is_explained:
        print_text("unexplained: no changed element was evaluated before. Please report it: it is a defect of snr_sim.")
    if found.until_s < float("inf"):
        print_text(f"compared up to {found.until_s:g} s, when an edit replaced the program of the run")
