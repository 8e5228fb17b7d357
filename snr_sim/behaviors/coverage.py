"""Which states, transitions, conditions and time-outs of machines were reached, over several runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from snr_sim.behaviors.explain import Evaluation
from snr_sim.behaviors.program import Program, Transition

# Path of its machine, the state that it leaves, its name and its line.
Arrow: TypeAlias = tuple[str, str, str, int]


@dataclass
class Tally:
    """How often a transition was looked at in one state, was taken, and was due with a false condition; how often the
    state was left before its time-out, and the longest time in it."""

    evaluated: int = 0
    taken: int = 0
    was_false: int = 0
    cancelled: int = 0
    longest_ns: int = 0
    last: Evaluation | None = None


@dataclass
class Coverage:
    """Counts evaluations, in the place of an `EvaluationLog`; the same one may serve several runs of a program."""

    states: set[tuple[str, str]] = field(default_factory=set)  # (path of the machine, state)
    tallies: dict[Arrow, Tally] = field(default_factory=dict)
    # Transitions that one machine took in sequence.
    pairs: Counter[tuple[Arrow, Arrow]] = field(default_factory=Counter)
    _last: dict[str, Arrow] = field(default_factory=dict)  # that each machine has taken in this run
    _t_ns: int = 0

    def keep(self, one: Evaluation, values: object) -> None:
        """Count an evaluation."""
        self.states.add((one.machine, one.state))
        tally = self.tallies.setdefault((one.machine, one.state, one.transition, one.line), Tally())
        last, tally.last = tally.last, one
        if last is not None and not last.is_true and one.t_ns >= last.t_ns:  # of the same run
            tally.cancelled += one.t_ns - one.elapsed_ns > last.t_ns - last.elapsed_ns  # entered since
        tally.evaluated += 1
        tally.longest_ns = max(tally.longest_ns, one.elapsed_ns)
        if one.t_ns < self._t_ns:  # another run
            self._last.clear()
        self._t_ns = one.t_ns
        if one.is_true:
            tally.taken += 1
            machine = one.machine.rsplit("/", 2)[0] if one.kind == "exit" else one.machine
            self.states.add((machine, one.target))
            self._follow(machine, (one.machine, one.state, one.transition, one.line))
        elif one.after_ns is None or one.elapsed_ns >= one.after_ns:
            tally.was_false += 1

    def _follow(self, machine: str, arrow: Arrow) -> None:
        """Count the transition of a machine after the last one of the machine that it is declared in."""
        if arrow[0] in self._last:
            self.pairs[self._last[arrow[0]], arrow] += 1
        # The machines inside will begin again.
        self._last = {path: last for path, last in self._last.items() if not path.startswith(f"{machine}/")}
        self._last[machine] = arrow

    def report(self, program: Program) -> dict[str, Any]:
        """Return what was reached of a program, as JSON.

        {"percent": of states and transitions together,
         "states": [{"machine", "state", "line", "is_reached"}],
         "transitions": [{"machine", "state", "transition", "line", "evaluated", "taken", "was_false"}],
         "conditions": [{"machine", "condition", "line", "was_true", "was_false"}]: each in all its transitions,
         "time_outs": [{"machine", "state", "transition", "line", "fired", "cancelled", "longest_s"}],
         "pairs": [{"machine", "first", "then", "line", "taken"}]: transitions in sequence; the line is of the second}
        """
        reached = self._with_initial(program)
        states = [
            {"machine": path, "state": one.name, "line": one.place.line, "is_reached": (path, one.name) in reached}
            for path, spawn in program.walk()
            for one in spawn.machine.states
        ]
        transitions: list[dict[str, Any]] = []
        time_outs: list[dict[str, Any]] = []
        was_true, was_false = Counter[tuple[str, str, int]](), Counter[tuple[str, str, int]]()
        for path, state, arrow in _arrows(program):
            tally = self.tallies.get((path, state, arrow.name, arrow.place.line), Tally())
            where = {"machine": path, "state": state, "transition": arrow.name, "line": arrow.place.line}
            counts = {"evaluated": tally.evaluated, "taken": tally.taken, "was_false": tally.was_false}
            transitions.append({**where, **counts})
            if arrow.after_ns is not None:
                longest_s = tally.longest_ns / 1e9
                time_outs.append({**where, "fired": tally.taken, "cancelled": tally.cancelled, "longest_s": longest_s})
            if arrow.condition is not None:
                key = path, arrow.condition.line, arrow.condition.place.line
                was_true[key] += tally.taken
                was_false[key] += tally.was_false
        done = [*(bool(row["is_reached"]) for row in states), *(row["taken"] > 0 for row in transitions)]
        return {
            "percent": 100.0 * done.count(True) / len(done) if done else 100.0,
            "states": states,
            "transitions": transitions,
            "conditions": [
                {"machine": key[0], "condition": key[1], "line": key[2], "was_true": count, "was_false": was_false[key]}
                for key, count in was_true.items()
            ],
            "time_outs": time_outs,
            "pairs": [
                {"machine": path, "first": name, "then": then[2], "line": then[3], "taken": self.pairs[first, then]}
                for first, then in _pairs(program)
                for path, _, name, _ in [first]
            ],
        }

    def counts(self, program: Program) -> dict[Arrow, int]:
        """Return how often each transition was taken, and whether each state was reached, for `export.draw`."""
        found = self.report(program)
        states = {(row["machine"], row["state"], "", 0): int(row["is_reached"]) for row in found["states"]}
        return states | {
            (row["machine"], row["state"], row["transition"], row["line"]): row["taken"] for row in found["transitions"]
        }

    def _with_initial(self, program: Program) -> set[tuple[str, str]]:
        """Return the states that were reached, with those in which a machine began inside a state that was."""
        reached = set(self.states)
        for path, spawn in program.walk():  # outer ones first
            around, _, _ = path.rpartition("/")
            machine, _, state = around.rpartition("/")
            if not around or (machine, state) in reached:
                reached.add((path, spawn.initial))
        return reached


def _arrows(program: Program) -> Iterator[tuple[str, str, Transition]]:
    """Yield each transition with the path of its machine and each state that it can leave."""
    for path, spawn in program.walk():
        for state in spawn.machine.states:
            for one in spawn.machine.transitions_of(state.name):
                yield path, state.name, one


def _pairs(program: Program) -> Iterator[tuple[Arrow, Arrow]]:
    """Yield transitions that can be taken in sequence; after an exit comes one of the machine around."""
    arrows: dict[tuple[str, str], list[Arrow]] = {}
    for path, state, one in _arrows(program):
        arrows.setdefault((path, state), []).append((path, state, one.name, one.place.line))
    for path, state, one in _arrows(program):
        machine = path.rsplit("/", 2)[0] if one.kind == "exit" else path
        for then in arrows.get((machine, one.target), []):
            yield (path, state, one.name, one.place.line), then
