"""`snr machine why RUN`: why state machines took a transition, or did not, with the values of their conditions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from snr_sim.cli.machine_replay import replay_machines
from snr_sim.cli.newest import trace_of
from snr_sim.cli.output import print_json, print_text
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest

if TYPE_CHECKING:
    from snr_sim.behaviors.explain import Evaluation, EvaluationLog
    from snr_sim.behaviors.program import Program
    from snr_sim.recording.reader import Trace

MAX_STEPS_SHOWN = 20
NS_PER_S = 1e9
MAX_S = 1e9  # of a run


def why(
    run: Path | None, machine: str, target: str, from_s: float, until_s: float, *, trust: bool, as_json: bool
) -> None:
    """Print why the transitions of a run's machines were taken or not, in an interval.

    Args:
        run: its folder; the newest one if None.
        machine: path of the machine; empty for all.
        target: only transitions to this state; empty for all.
        from_s, until_s: the interval.
        trust: whether files of another user may be executed without a question.
        as_json: whether to print JSON.
    """
    from snr_sim.behaviors.explain import EvaluationLog, summary

    if not 0.0 <= from_s <= until_s:
        raise ParameterError(f"The interval is from {from_s:g} s to {until_s:g} s.", fix="--from 10 --until 12.")
    trace = trace_of(run)
    evaluations = EvaluationLog(
        round(from_s * NS_PER_S), round(until_s * NS_PER_S) if until_s < 1e9 else 2**62, machine, target
    )
    states = _replay(trace, evaluations, trust=trust)
    if machine and machine not in states:
        raise UnknownNameError(f"This run has no machine '{machine}'.", fix=suggest(machine, states))
    known = {name for path, names in states.items() for name in names if machine in ("", path)}
    if target and target not in known and not evaluations.found:  # an edit may have added it
        raise UnknownNameError(f"There is no state '{target}' in its machines.", fix=suggest(target, sorted(known)))
    if as_json:
        print_json({"rows": summary(evaluations.found), "left_out": evaluations.left_out})
        return
    _print(evaluations, is_moment=until_s - from_s < 1.0)


def _replay(trace: Trace, evaluations: EvaluationLog, *, trust: bool) -> dict[str, list[str]]:
    """Execute the run again and log the evaluations; return the states of its machines by path."""
    programs: list[Program] = []

    def explained(program: Program) -> EvaluationLog:
        programs.append(program)
        return evaluations

    replay_machines(trace, trust=trust, evaluations=explained)
    if not programs:
        raise UnknownNameError("This run has no state machine.", fix="name a run whose controller has one.")
    found = [row for one in programs for row in one.walk()]
    return {path: [state.name for state in spawn.machine.states] for path, spawn in found}


def _print(evaluations: EvaluationLog, *, is_moment: bool) -> None:
    from snr_sim.behaviors.explain import summary

    if not evaluations.found:
        print_text("In this interval no transition was looked at: the machine was not in a state that has one.")
        return
    if is_moment:
        _print_steps(evaluations.found)
        return
    for row in summary(evaluations.found):
        print_text(f"line {row['line']}  {row['machine']}, in {row['state']}: {row['transition']}")
        print_text(f"    looked at {row['evaluated']} times, taken {row['taken']} times")
        if row["after_s"] is not None:
            print_text(f"    after {row['after_s']:g} s; the longest time in the state was {row['longest_s']:g} s")
        for text, value in row["values"].items():
            print_text(f"    {text} = {value}")
        for error, count in row["errors"].items():
            print_text(f"    failed {count} times: {error}")
    if evaluations.left_out:
        print_text(f"{evaluations.left_out} more were left out: choose a shorter interval.")


def _print_steps(found: list[Evaluation]) -> None:
    """Print each step of a short interval."""
    steps: dict[tuple[int, str], list[Evaluation]] = {}
    for one in found:
        steps.setdefault((one.t_ns, one.machine), []).append(one)
    for (t_ns, machine), rows in list(steps.items())[:MAX_STEPS_SHOWN]:
        first = rows[0]
        print_text(f"t = {t_ns / NS_PER_S:.4f} s  {machine} in {first.state} for {first.elapsed_ns / NS_PER_S:.4f} s")
        for row in rows:
            values: list[Any] = [f"{text} = {value}" for text, value in row.values.items()]
            if row.after_ns is not None:
                values.insert(0, f"{row.elapsed_ns / 1e6:g} of {row.after_ns / 1e6:g} ms")
            verdict = "taken" if row.is_true else f"fails ({row.error})" if row.error else "no"
            print_text(f"    line {row.line:<4} {row.transition:<28} {verdict:<6} {', '.join(values)}")
    if len(steps) > MAX_STEPS_SHOWN:
        print_text(f"... and {len(steps) - MAX_STEPS_SHOWN} more steps")
