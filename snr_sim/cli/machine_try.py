"""`snr machine try FILE RUN`: a changed program on the readings of a recorded run, before a robot runs it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from snr_sim.cli.machine_replay import replay_machines
from snr_sim.cli.newest import trace_of
from snr_sim.cli.output import print_json, print_text
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
    from snr_sim.scenario.machine_edits import changes_of, without_edits

    trace = trace_of(run)
    then = _ordered(changes_of(trace.records))
    if not then:
        raise ParameterError("This run has no state machine.", fix="name a run whose controller has one.")
    without, left_out = without_edits(trace)
    now = _ordered(change for one in replay_machines(without, file, trust=trust) for change in changes_of(one.records))
    pairs = zip_longest(then, now)
    first = next(((a, b) for a, b in pairs if a is None or b is None or _key(a) != _key(b)), None)
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


def _key(change: Change) -> tuple[Any, ...]:
    return tuple(change.get(name) for name in ("t_ns", "machine", "kind", "source", "target"))  # a flow has no kind


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
            shown = "no further change of state"
            if change is not None:
                name = change.get("name") or change["outcome"]
                shown = f"{change['machine']}: {change['source'] or '-'} -> {change['target'] or '-'} ({name})"
                shown = f"t = {change['t_ns'] / 1e9:.4f} s  {shown}"
            print_text(f"{'first difference, ' if when == 'recorded' else ''}{when}: {shown}")
    for row in states:
        is_new = "" if row["now"] == row["recorded"] else f" (recorded: {row['recorded']})"
        print_text(f"    {row['machine']}: {row['state']} entered {row['now']} times{is_new}")
    if first is not None:
        print_text("From there on the recorded readings no longer answer the program. With the robot in the loop:")
        print_text(f"    snr resim {trace.path.parent} --with FILE")
