"""`snr machine`: what can be done with a state machine without running the robot."""

from __future__ import annotations

import math
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from snr_sim.cli.arguments import AsJson
from snr_sim.cli.output import print_json, print_text
from snr_sim.cli.trust import Trust
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest

if TYPE_CHECKING:
    from snr_sim.behaviors.program import Problem, Program

_WHAT = ("draw", "check", "coverage", "diff", "edits", "explore", "lag", "record", "try", "view", "why")
SAME_MOMENT_S = 0.02  # of --at: two steps at 100 Hz
_FORMATS = ("mermaid", "dot", "scxml", "text")


def machine(
    what: Annotated[
        str, typer.Argument(help="draw, check, coverage, diff, edits, explore, lag, record, try, view or why.")
    ],
    file: Annotated[
        str,
        typer.Argument(
            help="An LRP program, or a Python file in which machine(...) is called. Of edits, lag, record, view, "
            "why and diff --with a run, of coverage a scenario."
        ),
    ],
    name: Annotated[str, typer.Option(help="Which machine, if a Python file or a run has several.")] = "",
    to: Annotated[
        str,
        typer.Option("--as", help="Of draw: mermaid, dot, scxml or text. Of coverage: mermaid or dot, with counts."),
    ] = "",
    robot: Annotated[str, typer.Option(help="Of an LRP program: the robot whose parts it names.")] = "",
    machine_path: Annotated[str, typer.Option("--machine", help="Of why: path of a machine; all if not given.")] = "",
    target: Annotated[str, typer.Option("--to", help="Of why: only transitions to this state.")] = "",
    at: Annotated[float | None, typer.Option(help="Of try and why: one moment [s].")] = None,
    from_s: Annotated[float, typer.Option("--from", help="Of record and why: begin of the interval [s].")] = 0.0,
    until_s: Annotated[
        float, typer.Option("--until", help="Of record and why: its end [s]; of why that of the run if not given.")
    ] = math.inf,
    with_file: Annotated[str, typer.Option("--with", help="Of diff and record: a program, for a run.")] = "",
    seeds: Annotated[str, typer.Option(help="Of coverage: seeds of the scenario, as 0..19.")] = "0..9",
    controller: Annotated[str, typer.Option(help="Of coverage: as of snr run.")] = "",
    min_percent: Annotated[float, typer.Option("--min", help="Of coverage: exit status 1 below it.")] = 0.0,
    port: Annotated[int, typer.Option(help="Of view: not any free port, but this one.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Of edits: folder that its files go into.")] = None,
    cases: Annotated[int, typer.Option(help="Of try without a run: how many random stories.")] = 1000,
    is_strict: Annotated[bool, typer.Option("--strict", help="Of try: a block that fails is a failure, too.")] = False,
    other: Annotated[str, typer.Argument(help="Of diff the new program, of try a run.")] = "",
    trust: Trust = False,
    as_json: AsJson = False,
) -> None:
    """Draw or check the state machines of a file, or explain those of a run.

    draw prints a machine in a format that other programs draw: mermaid in an editor or on a web page, dot with
    Graphviz; scxml is W3C's format of state machines, and text a listing. check prints what is wrong with a program or
    doubtful, with lines and columns. explore searches what it can do at all: states that no run can reach, or that
    cannot be left, transitions that never come first. coverage runs a scenario with several seeds and prints which
    states and transitions were not reached. edits writes the programs of a run that was edited as files, and runs it
    again with them. diff prints which states, transitions and variables differ between two programs; with --with,
    between the program of a run and another one, when the first of them is evaluated in that run, and where the replay
    with the other program first differs. try runs a changed program on the inputs of a recorded run: where its changes
    of state begin to differ, and which states it visits. The recorded readings do not answer it; with --at the run is
    simulated again up to that moment, and 10 s further with the run's program and with the changed one. Without a run,
    it tries random signals, readings and times, and prints the shortest story after which a rule (always ...) does not
    hold, as a test. lag prints how old readings were when machines decided, and how long commands took. record prints a
    piece of a run as a Python test, which runs the program on the readings of that piece and expects the recorded
    changes of state. why executes the run again and prints each transition that was looked at, with the values of its
    condition: at one moment step by step, over an interval as a summary. view serves a page that shows the machine at
    any moment of the run, as `snr run --live` does while it runs.

    Exit status: 0; of check 1 if the program has mistakes, of explore 1 if something was found, of coverage 1 below
    --min, of diff 1 if there are differences, and 3 if the replay differs before any changed element is evaluated,
    of edits and try 1 if the second run differs or a story fails, of record 1 if the test would fail.
    """
    if what not in _WHAT:
        raise UnknownNameError(f"snr machine cannot '{what}'.", fix=suggest(what, _WHAT))
    formats = _FORMATS[:2] if what == "coverage" else _FORMATS
    if to not in ("", *formats):
        raise UnknownNameError(f"There is no format '{to}'.", fix=suggest(to, formats))
    run = Path(file)
    if what == "check":
        _check(file, name, robot, as_json)
    elif what == "coverage":
        from snr_sim.cli.machine_coverage import coverage

        coverage(file, seeds, controller, min_percent, to=to, as_json=as_json)
    elif what == "diff":
        from snr_sim.cli.machine_diff import diff, diff_in_run

        if with_file:
            diff_in_run(run, with_file, trust=trust, as_json=as_json)
            return
        diff(_program_in(file, name, robot), _program_in(other, name, robot), other, as_json=as_json)
    elif what == "edits":
        from snr_sim.cli.machine_edits import edits

        edits(run, out, trust=trust, as_json=as_json)
    elif what == "explore":
        _explore(_program_in(file, name, robot), file, as_json)
    elif what == "lag":
        _lag(run, as_json)
    elif what == "record":
        if as_json:
            raise ParameterError("record prints a Python file, no JSON.", fix="leave out --json.")
        from snr_sim.cli.machine_record import record

        record(run, name, with_file, from_s, until_s, trust=trust)
    elif what == "try" and not other:
        from snr_sim.cli.machine_stories import try_stories
        from snr_sim.scenario.library import bridge_of_robot

        bridge = bridge_of_robot(robot) if robot else None
        try_stories(_program_in(file, name, robot), run, bridge, cases, is_strict=is_strict, as_json=as_json)
    elif what == "try":
        from snr_sim.cli.machine_try import rehearse_program, try_program

        if at is None:
            try_program(file, Path(other), trust=trust, as_json=as_json)
        else:
            rehearse_program(run, Path(other), name, at, trust=trust, as_json=as_json)
    elif what == "view":
        from snr_sim.cli.machine_view import view

        view(run, name, port, is_trusted=trust)
    elif what == "why":
        from snr_sim.cli.machine_why import why

        if at is not None:
            from_s, until_s = at, at + SAME_MOMENT_S
        why(run, machine_path, target, from_s, until_s, trust=trust, as_json=as_json)
    else:
        _draw(_program_in(file, name, robot), to or "mermaid", as_json)


def _draw(program: Program, to: str, as_json: bool) -> None:
    if as_json:
        raise ParameterError("draw prints no JSON.", fix="leave out --json, or name the format: --as scxml.")
    from snr_sim.behaviors.export import draw

    print_text(draw(program, to), end="")  # type: ignore[arg-type]


def _explore(program: Program, file: str, as_json: bool) -> None:
    """Print what a program can do at all; exit with status 1 if something may be a mistake."""
    from snr_sim.behaviors.explore import explore

    found = explore(program)
    if as_json:
        rows = [
            {
                "kind": one.kind, "machine": one.machine, "name": one.name, "line": one.place.line,
                "message": one.message, "word": list(one.word),
            }
            for one in found.findings
        ]  # fmt: skip
        print_json({**found._asdict(), "findings": rows})
    else:
        for one in found.findings:
            print_text(f"{file}:{one.place.line}: {one.message}")
            if one.word:
                runs = [(name, len(list(run))) for name, run in groupby(one.word)]
                way = (name if count == 1 else f"{name} ({count} times)" for name, count in runs)
                print_text(f"    shortest way there: {', '.join(way)}")
        for name in found.undecided:
            print_text(f"whether '{name}' always holds depends on readings or on variables that are not followed")
        if found.left_out:
            print_text(f"not followed, as they have too many values: {', '.join(found.left_out)}")
        print_text(f"{found.configurations} configurations, {len(found.findings) or 'nothing'} found")
    if any(one.kind != "only_time" for one in found.findings):
        raise typer.Exit(1)


def _lag(run: Path, as_json: bool) -> None:
    """Print the delays of a run."""
    from snr_sim.cli.newest import trace_of
    from snr_sim.scenario.machine_lag import lag_of

    found = lag_of(trace_of(run))
    if as_json:
        print_json(found)
        return
    if not found["transitions"]:
        print_text("no machine has changed its state in this run")
        return
    print_text("transitions  " + ", ".join(f"{machine}: {count}" for machine, count in found["transitions"].items()))
    for what, text in (("readings", "age at a transition"), ("commands", "until applied")):
        for key, row in found[what].items():
            print_text(f"{key:<12} {text}: mean {1000 * row['mean_s']:.0f} ms, at most {1000 * row['max_s']:.0f} ms")
    if not found["commands"]:
        print_text("commands: the robot's devices apply them at their next tick")


def _check(file: str, name: str, robot: str, as_json: bool) -> None:
    """Print the problems of a program; exit with status 1 if one is a mistake."""
    from snr_sim.behaviors.program import show_problem
    from snr_sim.scenario.library import LRP
    from snr_sim.scenario.machine_controller import MachineError

    try:
        program = _program_in(file, name, robot)
        problems = _doubts(program, is_text=Path(file).suffix == LRP)
        if not as_json:
            lines = Path(file).read_text(encoding="utf-8").splitlines()
            print_text(
                "\n".join(show_problem(one, file, lines) for one in problems) or f"{file}: no problem was found."
            )
    except MachineError as error:
        problems = error.problems
        if not as_json:
            print_text(error)
    if as_json:
        print_json({"problems": [_row(one) for one in problems]})
    if any(one.is_error for one in problems):
        raise typer.Exit(1)


def _doubts(program: Program, *, is_text: bool) -> list[Problem]:
    """Return what is doubtful in a program, in the order of its text."""
    from snr_sim.behaviors.checks import doubts_of
    from snr_sim.behaviors.program import Problem
    from snr_sim.scenario.machine_controller import STEP_HZ

    step_ns, found = round(1e9 / STEP_HZ), {**dict.fromkeys(program.warnings)}
    found |= dict.fromkeys(doubts_of(program.spawns, also_ends=True))
    for one in (arrow for _, spawn in program.walk() for arrow in spawn.machine.transitions) if is_text else ():
        if isinstance(one.after_ns, int) and one.after_ns % step_ns:
            steps = -(-one.after_ns // step_ns)
            message = f"After {one.after_ns / 1e6:g} ms there is no step: it is taken at {steps * step_ns / 1e6:g} ms."
            fix = f"a multiple of {step_ns / 1e6:g} ms."
            found[Problem(one.place, message, fix, is_error=False)] = None
    return sorted(found, key=lambda one: (one.place.line, one.place.column))


def _row(problem: Problem) -> dict[str, Any]:
    place = problem.place
    return {
        "line": place.line, "column": place.column, "end_line": place.end_line, "end_column": place.end_column,
        "message": problem.message, "fix": problem.fix, "is_error": problem.is_error,
    }  # fmt: skip


def _program_in(file: str, name: str, robot: str) -> Program:
    """Return the program of a file."""
    from snr_sim.scenario.library import LRP, bridge_of_robot, load_program

    if Path(file).suffix != LRP:
        return _python_program(file, name)
    from snr_sim.scenario.machine_controller import read_program

    if not Path(file).is_file():
        raise UnknownNameError(f"There is no file '{file}'.", fix="name an LRP program: snr machine draw landing.lrp.")
    return read_program(Path(file), load_program, bridge_of_robot(robot) if robot else None)


def _python_program(file: str, name: str) -> Program:
    """Return the machine of a Python file, or the one of a name."""
    from snr_sim.behaviors.program import Program
    from snr_sim.scenario.library import load_program

    module = load_program(file, fix="name the Python file of the machine: snr machine draw mission.py.")
    found = {key: value for key, value in vars(module).items() if isinstance(value, Program)}
    if not found:
        raise UnknownNameError(f"{file} has no machine.", fix='MISSION = machine("mission", ...), outside functions.')
    if name and name not in found:
        raise UnknownNameError(f"{file} has no machine '{name}'.", fix=suggest(name, found))
    inner = {id(spawn.machine) for one in found.values() for path, spawn in one.walk() if "/" in path}
    outer = [key for key, value in found.items() if id(value.spawns[0].machine) not in inner]
    if not name and len(outer) != 1:
        raise UnknownNameError(f"{file} has several machines.", fix=f"--name, {suggest('', outer or found)}")
    return found[name or outer[0]]
