"""Which states, transitions, conditions and time-outs of machines were reached, over several runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from snr_sim.behaviors.explain import Evaluation
from snr_sim.behaviors.program import Program, Transition


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
    tallies: dict[tuple[str, str, str, int], Tally] = field(default_factory=dict)

    def keep(self, one: Evaluation, values: object) -> None:
        """Count an evaluation."""
        self.states.add((one.machine, one.state))
        tally = self.tallies.setdefault((one.machine, one.state, one.transition, one.line), Tally())
        last, tally.last = tally.last, one
        if last is not None and not last.is_true and one.t_ns >= last.t_ns:  # of the same run
            tally.cancelled += one.t_ns - one.elapsed_ns > last.t_ns - last.elapsed_ns  # entered since
        tally.evaluated += 1
        tally.longest_ns = max(tally.longest_ns, one.elapsed_ns)
        if one.is_true:
            tally.taken += 1
            machine = one.machine.rsplit("/", 2)[0] if one.kind == "exit" else one.machine
            self.states.add((machine, one.target))
        elif one.after_ns is None or one.elapsed_ns >= one.after_ns:
            tally.was_false += 1

    def report(self, program: Program) -> dict[str, Any]:
        """Return what was reached of a program, as JSON.

        {"percent": of states and transitions together,
         "states": [{"machine", "state", "line", "is_reached"}],
         "transitions": [{"machine", "state", "transition", "line", "evaluated", "taken", "was_false"}],
         "conditions": [{"machine", "condition", "line", "was_true", "was_false"}]: each in all its transitions,
         "time_outs": [{"machine", "state", "transition", "line", "fired", "cancelled", "longest_s"}]}
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
            where: dict[str, Any] = {
                "machine": path,
                "state": state,
                "transition": arrow.name,
                "line": arrow.place.line,
            }
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
