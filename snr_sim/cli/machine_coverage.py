"""`snr machine coverage SCENARIO`: what its machines reach over several seeds."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import typer

from snr_sim.behaviors.coverage import Coverage
from snr_sim.behaviors.explain import explaining
from snr_sim.behaviors.program import Program
from snr_sim.cli.output import capture_output, print_json, print_text
from snr_sim.prelude.errors import ParameterError, UnknownNameError
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

MAX_SEEDS = 10_000


def coverage(
    scenario: str, seeds: str, controller: str, min_percent: float, *, to: str = "", as_json: bool = False
) -> None:
    """Run a scenario with several seeds, "0..19" or one, unrecorded, and print what its machines reached.

    The exit status is 1 if it is less than `min_percent` of states and transitions. With a format `to`, the machines
    are drawn in it with counts.
    """
    found: dict[str, tuple[Program, Coverage]] = {}
    with capture_output(is_json=True):
        outcomes = Counter(_run(scenario, seed, controller, found) for seed in _seeds(seeds))
    reports = {name: counted.report(program) for name, (program, counted) in found.items()}
    if as_json:
        print_json({"outcomes": outcomes, "machines": reports})
    elif to:
        from snr_sim.behaviors.export import draw

        for program, counted in found.values():
            print_text(draw(program, to, counted.counts(program)), end="")  # type: ignore[arg-type]
    else:
        print_text("runs: " + ", ".join(f"{count} {outcome}" for outcome, count in outcomes.items()))
        for name, report in reports.items():
            _print(name, report)
    if any(report["percent"] < min_percent for report in reports.values()):
        raise typer.Exit(1)


def _seeds(text: str) -> range:
    match = re.fullmatch(r"(\d{1,9})(?:\.\.(\d{1,9}))?", text)
    if match is None:
        raise ParameterError(f"--seeds {text} is not a range of seeds.", fix="--seeds 0..19, or --seeds 3.")
    first, last = int(match[1]), int(match[2] or match[1])
    if not first <= last < first + MAX_SEEDS:
        raise ParameterError(f"--seeds {text}: 1 to {MAX_SEEDS} of them.", fix="--seeds 0..19.")
    return range(first, last + 1)


def _run(scenario: str, seed: int, controller: str, found: dict[str, tuple[Program, Coverage]]) -> str:
    """Run one seed, and add what its machines did; return the outcome."""
    simulation = prepare(Request(scenario, seed, controller=controller or None))
    plant = simulation.plant()
    config = simulation.config(plant)

    def counted(program: Program) -> Coverage:
        name = program.spawns[0].machine.name if program.spawns else "machine"
        return found.setdefault(name, (program, Coverage()))[1]

    with explaining(counted):
        outcome = SimulationRun(simulation, plant, config).run().outcome
    if not found:
        raise UnknownNameError("The controller has no state machine.", fix="--controller FILE of one that has.")
    return outcome


def _print(name: str, report: dict[str, Any]) -> None:
    states, transitions = report["states"], report["transitions"]
    reached = sum(row["is_reached"] for row in states)  # exact: integers
    taken = sum(row["taken"] > 0 for row in transitions)  # exact: integers
    print_text(
        f"{name}: {report['percent']:.0f} %: {reached} of {len(states)} states, {taken} of {len(transitions)} "
        "transitions"
    )
    for row in states:
        if not row["is_reached"]:
            print_text(f"    line {row['line']:<4} {row['machine']}: state {row['state']} was not reached")
    for row in transitions:
        where = f"    line {row['line']:<4} {row['machine']}: {row['transition']} in {row['state']}"
        if not row["taken"]:
            looked = f"looked at {row['evaluated']} times" if row["evaluated"] else "never looked at"
            print_text(f"{where} was not taken, {looked}")
        elif not row["was_false"] and row["evaluated"] == row["taken"]:
            print_text(f"{where} was always taken")
    for row in report["conditions"]:
        where = f"    line {row['line']:<4} {row['machine']}: condition {row['condition']}"
        if bool(row["was_true"]) != bool(row["was_false"]):
            print_text(f"{where} was never {'false' if row['was_true'] else 'true'}")
    in_sequence = [row["taken"] > 0 for row in report["pairs"]]
    if in_sequence:
        print_text(f"    {in_sequence.count(True)} of {len(in_sequence)} pairs of transitions in sequence")
    for row in report["time_outs"]:
        where = f"    line {row['line']:<4} {row['machine']}: the time of {row['transition']} in {row['state']}"
        if not row["fired"]:
            print_text(f"{where} was never over: {row['longest_s']:g} s at most, left {row['cancelled']} times before")
