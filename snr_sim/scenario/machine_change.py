"""What a changed program would have done in a recorded run, and whether the change explains the first difference.

The run is executed again twice, as it was and with the new program. Until a changed element is evaluated in one of the
two, both must do the same: a difference before is a defect of the interpreter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from snr_sim.behaviors.alarm import alarm_key
from snr_sim.behaviors.diff import Difference, differences
from snr_sim.behaviors.explain import Evaluation, Evaluations
from snr_sim.behaviors.interpreter import NS_PER_S
from snr_sim.behaviors.program import ANY, Program, Transition
from snr_sim.prelude.errors import TraceError
from snr_sim.recording.checker import Divergence, NodeReplay
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import Executed, InputRecord, Record
from snr_sim.scenario.machine_edits import EDITS, changes_of

Replay = Callable[[bool, Callable[[Program], Evaluations]], Sequence[NodeReplay]]


@dataclass(frozen=True)
class ProgramChange:
    """A change of a program, in a run.

    Args:
        differences: between the programs.
        first: the element that was evaluated first; None if none was.
        first_s: when; infinite if none was.
        divergence: the first difference of the replay with the new program; None if there is none.
        until_s: when an edit replaced the program in the run: no further was compared.
    """

    differences: list[Difference]
    first: Difference | None
    first_s: float
    divergence: Divergence | None
    until_s: float

    @property
    def is_explained(self) -> bool:
        """Whether nothing differs before a changed element was evaluated."""
        return self.divergence is None or self.divergence.t >= self.first_s


def change_of(trace: Trace, replay: Replay) -> ProgramChange:
    """Compare a run with its replay with another program.

    Args:
        trace: of the run.
        replay: executes it again, with tolerances `LINES`: as it was, or (true) with the new program; its second
            argument returns what takes the evaluations of a program's conditions.

    Raises:
        TraceError: the run is not the same when it is executed again.
    """
    old, new = (_Ran() for _ in range(2))
    edits = (one.t for one in trace.records if isinstance(one, InputRecord) and one.name.endswith(EDITS))
    until_s = next(edits, math.inf)
    if _first(replay(False, old.add), until_s) is not None:
        raise TraceError("This run differs when it is executed again.", fix="look there first: snr replay --check.")
    replays = replay(True, new.add)
    old.take(trace.records)
    new.take(record for one in replays for record in one.records)
    found = [one for pair in zip(old.programs, new.programs, strict=False) for one in differences(*pair)]
    times = {one: _evaluated_ns(one, old, new) / NS_PER_S for one in found}
    first = min(found, key=times.__getitem__, default=None)
    first_s = math.inf if first is None else times[first]
    is_evaluated = first_s < until_s
    divergence = _first(replays, until_s)
    return ProgramChange(
        found, first if is_evaluated else None, first_s if is_evaluated else math.inf, divergence, until_s
    )


def _first(replays: Sequence[NodeReplay], until_s: float) -> Divergence | None:
    found = [one for replay in replays for one in replay.divergences if one.t < until_s]
    return min(found, key=lambda one: (one.t, one.seq), default=None)


@dataclass
class _Ran:
    """What machines did in one of the two runs.

    Args:
        programs: of the machines, in the order in which they were made.
        lines: when the transition of a machine in a line was first evaluated [ns].
        states: when any transition of a state of a machine was.
        entered, left: when a state of a machine was first entered and left.
        events: when an event first came.
        has_alarm: whether a machine has no clock.
    """

    programs: list[Program] = field(default_factory=list)
    lines: dict[tuple[str, int], float] = field(default_factory=dict)
    states: dict[tuple[str, str], float] = field(default_factory=dict)
    entered: dict[tuple[str, str], float] = field(default_factory=dict)
    left: dict[tuple[str, str], float] = field(default_factory=dict)
    events: dict[str, float] = field(default_factory=dict)
    has_alarm: bool = False

    def add(self, program: Program) -> Evaluations:
        """Take the evaluations of a program."""
        self.programs.append(program)
        return self

    def keep(self, one: Evaluation, values: Callable[[], dict[str, str]]) -> None:
        """Take one evaluation."""
        self.lines.setdefault((one.machine, one.line), one.t_ns)
        self.states.setdefault((one.machine, one.state), one.t_ns)

    def take(self, records: Iterable[Record]) -> None:
        """Take the changes of state, and the events, of a recording."""
        executed = [one for one in records if isinstance(one, Executed)]
        for record in executed:
            if record.type == "event":
                self.events.setdefault(record.name, record.t * NS_PER_S)
            self.has_alarm = self.has_alarm or record.name.endswith(alarm_key(""))
        for change in changes_of(executed):
            self.entered.setdefault((change["machine"], change["target"]), change["t_ns"])
            self.left.setdefault((change["machine"], change["source"]), change["t_ns"])

    def transition(self, path: str, line: int) -> Transition | None:
        """Return the transition of a machine in a line, if there is one."""
        spawns = [spawn for program in self.programs for at, spawn in program.walk() if at == path]
        return next((one for spawn in spawns for one in spawn.machine.transitions if one.place.line == line), None)


def _evaluated_ns(one: Difference, old: _Ran, new: _Ran) -> float:
    """Return when an element that differs was first evaluated in either run [ns]; infinite if it never was."""
    return min((time for ran in (old, new) for time in _times(one, ran, is_new=ran is new)), default=math.inf)


def _times(one: Difference, ran: _Ran, *, is_new: bool) -> Iterator[float]:
    """Yield the times [ns] at which an element may have been evaluated in a run."""
    path, name = one.machine, one.name
    if one.what in ("variable", "rule", "program") or (one.what == "transition" and ran.has_alarm):
        yield 0.0  # they count from the beginning; conditions of a machine with an alarm, as they decide when it steps
    elif one.what == "machine":
        # The order of its transitions counts in each of its states, its initial state whenever it is spawned.
        times = ran.states if one.how.startswith("order") else ran.entered
        yield from (time for (machine, _), time in times.items() if machine == path)
    elif one.what == "state":
        yield from _times_of_state(one, ran, one.how.removeprefix("renamed to ") if is_new else name)
    else:
        if one.how == ("removed" if is_new else "added"):
            return
        line = one.line if is_new or not one.old_line else one.old_line
        yield ran.lines.get((path, line), math.inf)
        transition = ran.transition(path, line)
        if transition is not None and transition.signal is not None:
            yield ran.events.get(transition.signal, math.inf)
        if transition is not None and transition.kind == "eps":  # then all transitions are looked at, as it is entered
            at = (time for key, time in ran.entered.items() if key[0] == path)
            source = ran.entered.get((path, transition.source), math.inf)
            yield min(at, default=math.inf) if transition.source == ANY else source


def _times_of_state(one: Difference, ran: _Ran, name: str) -> Iterator[float]:
    path = one.machine
    if "changed" not in one.how:  # added, removed or renamed
        yield from (ran.entered.get((path, each), math.inf) for each in (one.name, name))
        return
    if "onentry" in one.how:
        yield ran.entered.get((path, one.name), math.inf)
    if "running" in one.how:  # in its first step, if it has transitions; else it is not known better
        yield ran.states.get((path, one.name), ran.entered.get((path, one.name), math.inf))
    if "onexit" in one.how:
        yield ran.left.get((path, one.name), math.inf)
        inside = (time for (machine, state), time in ran.left.items() if path.startswith(f"{machine}/{state}/"))
        yield from inside
