"""`snr replay RUN`: runs the handlers again on the recorded inputs and reports whether the results are the same."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from snr_sim.cli.arguments import AsJson, RecordedRun
from snr_sim.cli.newest import trace_of
from snr_sim.cli.output import capture_output, print_json, print_note, print_text
from snr_sim.cli.trust import Trust, ask
from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.errors import MissingExtraError, SnrError

if TYPE_CHECKING:
    from snr_sim.recording.checker import Divergence, NodeReplay
    from snr_sim.recording.compare import Tolerance
    from snr_sim.recording.nondeterminism import NondeterministicCall
    from snr_sim.recording.reader import Trace
    from snr_sim.scenario.replay_files import ReplayFiles

_OPEN_LOOP = "after this the recorded sensors no longer answer your code"


def replay(
    run: RecordedRun = None,
    keep_program: Annotated[
        bool, typer.Option("--keep-program", help="Leave out edits of state machines that came while it ran.")
    ] = False,
    check: Annotated[
        bool,
        typer.Option(
            "--check", help="Also name handlers that ask clock, chance, files or threads; refuse a changed trace."
        ),
    ] = False,
    with_file: Annotated[
        str,
        typer.Option("--with", help="Another controller: a name, or a file as it is today."),
    ] = "",
    trust: Trust = False,
    tolerance: Annotated[
        list[str],
        typer.Option(help="PATH=1e-6, PATH=0.1% or PATH=ignore; may be repeated. PATH as printed, * allowed."),
    ] = [],  # noqa: B006
    as_json: AsJson = False,
) -> None:
    """Replay a run and compare.

    The handlers are executed again on the recorded inputs: the code that the run was recorded with, of which copies
    are in its folder. If another user may have written it, you are asked first. --with replaces the controller. Where a
    state machine was edited while it ran, each edit then takes over when it comes; --keep-program leaves edits out.

    Exit status: 0 identical, 1 diverged (the first divergence is printed), 2 the trace cannot be used: with --check
    also if its digest is not the one in result.json.
    """
    from snr_sim.recording.compare import Tolerance
    from snr_sim.recording.folder import check_unchanged
    from snr_sim.scenario.replay_files import files_of_replay

    tolerances = [Tolerance.parse(text) for text in tolerance]
    trace = trace_of(run)
    if check:
        check_unchanged(trace)
    folder = trace.path.parent.resolve()
    plan = files_of_replay(trace, with_file)
    ask(trace.path.parent, plan.unknown, trust)
    if plan.executed and not as_json:
        print_line(sys.stderr, f"executes{', as recorded' if plan.is_recorded else ''}: {', '.join(plan.executed)}")
    note = ""
    if with_file or keep_program:
        from snr_sim.scenario.library import LRP
        from snr_sim.scenario.machine_edits import LINES, without_edits

        kept, note = without_edits(trace)
        if keep_program:
            trace = kept
        elif note:
            note = "Edits of the run replace the program, each when it came. Only --keep-program leaves them out."
        tolerances += LINES if with_file.endswith(LRP) else ()
    with capture_output(is_json=True):  # keeps output of handlers out of the result
        done = _replay(trace, plan, with_file, tolerances, check)
    done.notes[:0] = [note] if note else []
    if with_file:
        done.notes.extend(_write_comparison(trace, done.replays, folder))
    if done.divergences:
        done.notes[:0] = environment_note(trace)
    if as_json:
        print_json({**_fields(trace, done), "executed": plan.executed})
    else:
        _print_comparison(trace, done)
    sys.exit(1 if done.divergences else 0)


class _Replayed:
    """Result of the replay of a run: of each node, and the calls that do not repeat."""

    def __init__(self, replays: list[NodeReplay], calls: list[NondeterministicCall], notes: list[str]) -> None:
        self.replays, self.calls, self.notes = replays, calls, notes
        self.tasks = sum(replay.executed for replay in replays)
        divergences = (one for replay in replays for one in replay.divergences)
        self.divergences: list[Divergence] = sorted(divergences, key=lambda one: one.seq)
        self.first_command = next((one for one in self.divergences if one.is_command), None)


def _replay(trace: Trace, plan: ReplayFiles, with_file: str, tolerances: list[Any], is_checking: bool) -> _Replayed:
    from contextlib import ExitStack

    from snr_sim.core.reload.sources import reading_from
    from snr_sim.recording.folder import trace_warnings
    from snr_sim.recording.nondeterminism import detect_nondeterminism
    from snr_sim.recording.replay import describe_reloads

    with ExitStack() as stack:
        found = stack.enter_context(detect_nondeterminism()) if is_checking else {}
        stack.enter_context(reading_from(plan.files))
        replays, notes = replay_nodes(trace, plan, with_file, tolerances)
    if with_file or not plan.is_recorded:
        notes.extend(describe_reloads(trace, [record for replay in replays for record in replay.records]))
    notes.extend(trace_warnings(trace))
    return _Replayed(replays, list(found.values()), notes)


def replay_nodes(
    trace: Trace, plan: ReplayFiles, with_file: str, tolerances: Sequence[Tolerance]
) -> tuple[list[NodeReplay], list[str]]:
    """Execute each node of a run again, while files are read from the plan's; return the replays, and notes."""
    from snr_sim.recording.replay import reload_sources, replay_node

    config, notes = config_of_replay(trace, plan, with_file)
    replays: list[NodeReplay] = []
    for node in trace.header.nodes:
        if replays and reload_sources(trace):
            plan.files.begin_node()  # another node may have been reloaded
            config, _ = config_of_replay(trace, plan, with_file)
        replays.append(replay_node(trace, node.removesuffix("_node"), config, tolerances, plan.files.begin_task))
    return replays, notes


def config_of_replay(trace: Trace, plan: ReplayFiles, with_file: str) -> tuple[Any, list[str]]:
    """Return the configuration to replay with, and notes about it."""
    from dataclasses import replace

    from snr_sim.recording.sources import program_sources
    from snr_sim.scenario.library import OPTION_FILE
    from snr_sim.scenario.simulation import prepare, request_of, wiring_of_file

    header, trace_info = trace.header, trace.trace_info
    if not header.scenario:
        config = wiring_of_file(with_file or trace_info.controller, header.roles)
        now = {} if with_file else program_sources(Path(trace_info.controller))
    else:
        simulation = prepare(replace(request_of(trace_info, header, with_file), options=plan.options))
        config = simulation.config(None)
        now = simulation.sources()
    changed = [name for name, then in header.sources.items() if now.get(name) != then]
    files = [name.removeprefix(OPTION_FILE) for name in changed if name.startswith(OPTION_FILE)]
    notes = [
        f"The {key} FILE is another one than was recorded: {header.options[key]}. Where the replay differs, look there "
        "before you look at the code."
        for key in files
    ]
    if not with_file:
        notes += [f"Changed since the run: {name}" for name in changed if not name.startswith(OPTION_FILE)]
        notes += [
            f"Changed since the run: {name}. This replay executes it as it was recorded; --with FILE executes today's."
            for name in plan.changed
        ]
    return config, notes


def environment_note(trace: Trace) -> list[str]:
    """Return a note on the differences between the recorded and the current environment, or an empty list."""
    from snr_sim import __version__
    from snr_sim.recording.folder import environment_changes, package_versions

    changes = environment_changes(trace.header, package_versions(), __version__)
    if not changes:
        return []
    return [f"Recorded with something else: {'; '.join(changes)}. Look there before you look at the code."]


def _write_comparison(trace: Trace, replays: list[NodeReplay], folder: Path) -> list[str]:
    marks = [(one.seq, one.t, sentence_of(one)) for replay in replays for one in replay.divergences]
    records = [record for replay in replays for record in replay.records]
    try:
        from snr_sim.view.view import write_comparison

        path = folder / "replayed.rrd"
        write_comparison(trace.header, trace.records, records, marks, path, 2 * trace.path.stat().st_size)
    except MissingExtraError as error:
        return [f"Both runs side by side: {error.message} {error.fix}"]
    except (OSError, SnrError) as error:
        return [f"Both runs side by side could not be written: {error}"]
    return [f"Both runs on one timeline: snr view {path}"]


def sentence_of(one: Divergence) -> str:
    """Return a divergence as a sentence."""
    from snr_sim.recording.checker import HANDLER

    who = f"{one.component}.{one.handler}" if one.handler else one.component
    if one.field == HANDLER:
        return f"{who} was {one.recorded} then, and is {one.replayed} now"
    if one.kind == "missing":
        return f"{who} returned {one.field} then, and does not now"
    if one.kind == "extra":
        return f"{who} returns {one.field} now, and did not then"
    return f"{who}: {one.field} was {one.recorded!r}, now {one.replayed!r}" + (
        " (reordered)" if one.kind == "reordered" else ""
    )


def _print_comparison(trace: Trace, done: _Replayed) -> None:
    for note in done.notes:
        print_note(note)
    for call in done.calls:
        print_text(f"asks the outside: {call}")
    if not done.divergences:
        print_text(f"identical: {done.tasks} tasks of {len(done.replays)} node(s), every task and page as recorded")
        return
    first = done.divergences[0]
    print_text(f"diverged: {len(done.divergences)} difference(s) in {done.tasks} tasks; the first:")
    print_text(f"  seq {first.seq}, t = {first.t:.3f} s, node {first.node}, while handling {first.task}")
    print_text(f"  component {first.component}, handler {first.handler or '-'} ({first.kind})")
    print_text(f"  {first.field}: recorded {first.recorded!r}, replayed {first.replayed!r}")
    if first.hint:
        from snr_sim.recording.records import hash_seed  # which determines the order of sets

        then, now = trace.trace_info.hash_seed, hash_seed()
        print_text(f"  {first.hint} PYTHONHASHSEED was {then} then, and is {now} now.")
    print_text("  how it came to that:")
    for cause in first.causes:
        print_text(f"    {cause}")
    if done.first_command is not None:
        seq, time_s = done.first_command.seq, done.first_command.t
        print_text(f"  commands to actuators differ from seq {seq}, t = {time_s:.3f} s: {_OPEN_LOOP}.")
        print_text(f"  the closed loop again: snr resim {trace.path.parent}")


def writable(one: Divergence) -> Divergence:
    """Return a divergence with JSON-compatible values: null would not distinguish NaN from infinity."""
    from dataclasses import replace

    shown = [
        repr(value) if isinstance(value, float) and not math.isfinite(value) else value
        for value in (one.recorded, one.replayed)
    ]
    return replace(one, recorded=shown[0], replayed=shown[1])


def _fields(trace: Trace, done: _Replayed) -> dict[str, Any]:
    from dataclasses import asdict

    seq = None if done.first_command is None else done.first_command.seq
    return {
        "run_dir": str(trace.path.parent),
        "trace_digest": trace.digest,
        "identical": not done.divergences,
        "tasks": done.tasks,
        "nodes": [
            {"node": one.node, "tasks": one.executed, "recorded": one.recorded, "divergences": len(one.divergences)}
            for one in done.replays
        ],
        "divergences": len(done.divergences),
        "first_divergence": asdict(writable(done.divergences[0])) if done.divergences else None,
        "commands_differ_from_seq": seq,
        "warning": None if seq is None else f"seq {seq}: {_OPEN_LOOP}",
        "outside_calls": [asdict(call) for call in done.calls],
        "notes": done.notes,
    }
