"""`snr machine try FILE RUN`: a changed program on the readings of a recorded run, or in its simulation, before a robot
runs it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from snr_sim.cli.machine_replay import replay_machines
from snr_sim.cli.newest import trace_of
from snr_sim.cli.output import capture_output, print_json, print_text
from snr_sim.cli.trust import ask
from snr_sim.prelude.errors import ParameterError

if TYPE_CHECKING:
    from snr_sim.recording.reader import Trace

Change = dict[str, Any]


def try_program(file: str, run: Path, *, trust: bool, as_json: bool) -> None:
    """Run a program on the inputs of a recorded run, and print where its changes of state begin to differ.

    Args:
        file: the program.
        run: its folder.
        trust: whether files of another user may be executed without a question.
        as_json: whether to print JSON.
    """
    from snr_sim.scenario.machine_edits import changes_of, key_of_change, without_edits

    trace = trace_of(run)
    then = _ordered(changes_of(trace.records))
    if not then:
        raise ParameterError("This run has no state machine.", fix="name a run whose controller has one.")
    without, left_out = without_edits(trace)
    now = _ordered(change for one in replay_machines(without, file, trust=trust) for change in changes_of(one.records))
    pairs = zip_longest(then, now)
    first = next(((a, b) for a, b in pairs if a is None or b is None or key_of_change(a) != key_of_change(b)), None)
    visits = [Counter((one["machine"], one["target"]) for one in rows if one["target"]) for rows in (then, now)]
    states = [
        {"machine": machine, "state": state, "recorded": visits[0][machine, state], "now": visits[1][machine, state]}
        for machine, state in visits[0] | visits[1]
    ]
    if as_json:
        print_json({"first": first, "states": states, "edits_left_out": len(trace.records) - len(without.records)})
    else:
        _print(first, states, left_out, trace)
    if first is not None:
        raise typer.Exit(1)


def rehearse_program(file: Path, run: Path, name: str, at_s: float, *, trust: bool, as_json: bool) -> None:
    """Run a simulated run again, and from a moment on with another program; print what the machines do then.

    Args:
        file: the program.
        run: its folder.
        name: of the machine's component; empty if there is one only.
        at_s: the moment.
        trust: whether files of another user may be executed without a question.
        as_json: whether to print JSON.
    """
    from snr_sim.behaviors.imports import texts_of
    from snr_sim.scenario.rehearsal import rehearse
    from snr_sim.scenario.replay_files import files_of_resim

    trace = trace_of(run)
    ask(trace.path.parent, files_of_resim(trace), trust)
    text = file.read_text("utf-8", "replace")

    def read_text(other: str) -> str | None:
        path = file.parent / other
        return path.read_text("utf-8", "replace") if path.is_file() else None

    with capture_output(is_json=True):
        found = rehearse(trace, text, texts_of(text, read_text), at_s, name)
    if as_json:
        print_json(asdict(found))
        return
    print_text(f"From {found.at_s:g} s to {found.until_s:g} s of the simulation, run again:")
    for what, course in (("with its own program", found.unchanged), (f"with {file}", found.edited)):
        count = len(course.changes)
        print_text(f"{what}: {count} {'change' if count == 1 else 'changes'} of state")
        for line in [*map(_shown, course.changes), *([course.end] if course.end else [])]:
            print_text(f"    {line}")


def _ordered(changes: Iterable[Change]) -> list[Change]:
    """Return changes in the order of time and machine: nodes side by side have no common one."""
    return sorted(changes, key=lambda one: (one["t_ns"], one["machine"]))


def _print(
    first: tuple[Change | None, Change | None] | None, states: list[dict[str, Any]], left_out: str, trace: Trace
) -> None:
    if left_out:
        print_text(left_out)
    if first is None:
        print_text("identical: every change of state as recorded")
    else:
        for when, change in zip(("recorded", "now"), first, strict=True):
            shown = "no further change of state" if change is None else _shown(change)
            print_text(f"{'first difference, ' if when == 'recorded' else ''}{when}: {shown}")
    for row in states:
        is_new = "" if row["now"] == row["recorded"] else f" (recorded: {row['recorded']})"
        print_text(f"    {row['machine']}: {row['state']} entered {row['now']} times{is_new}")
    if first is not None:
        print_text("From there on the recorded readings no longer answer the program. With the robot in the loop:")
        print_text(f"    snr resim {trace.path.parent} --with FILE")


def _shown(change: Change) -> str:
    name = change.get("name") or change["outcome"]
    where = f"{change['machine']}: {change['source'] or '-'} -> {change['target'] or '-'}"
    return f"t = {change['t_ns'] / 1e9:.4f} s  {where} ({name})"
