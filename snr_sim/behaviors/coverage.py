"""Which states and transitions of machines were reached, over several runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from snr_sim.behaviors.explain import Evaluation
from snr_sim.behaviors.program import MachineDef, Program, Transition


@dataclass
class Coverage:
    """Counts evaluations, in the place of an `EvaluationLog`; the same one may serve several runs of a program."""

    has_values: bool = False
    states: set[tuple[str, str]] = field(default_factory=set)  # (path of the machine, state)
    counts: dict[tuple[str, str, str, int], list[int]] = field(default_factory=dict)  # evaluated, taken, due and false

    def is_selected(self, t_ns: int, machine: str, target: str) -> bool:
        """Return True: everything counts."""
        return True

    def keep(self, one: Evaluation) -> None:
        """Count an evaluation."""
        self.states.add((one.machine, one.state))
        counts = self.counts.setdefault((one.machine, one.state, one.transition, one.line), [0, 0, 0])
        counts[0] += 1
        if one.is_true:
            counts[1] += 1
            machine = one.machine.rsplit("/", 2)[0] if one.kind == "exit" else one.machine
            self.states.add((machine, one.target))
        elif one.after_ns is None or one.elapsed_ns >= one.after_ns:
            counts[2] += 1

    def report(self, program: Program) -> dict[str, Any]:
        """Return what was reached of a program, as JSON.

        {"percent": of states and transitions together,
         "states": [{"machine", "state", "line", "is_reached"}],
         "transitions": [{"machine", "state", "transition", "line", "evaluated", "taken", "was_false"}]}
        """
        reached = self._with_initial(program)
        states = [
            {"machine": path, "state": one.name, "line": one.place.line, "is_reached": (path, one.name) in reached}
            for path, spawn in program.walk()
            for one in spawn.machine.states
        ]
        transitions = [
            self._row(path, state, arrow) for path, spawn in program.walk() for state, arrow in _arrows(spawn.machine)
        ]
        done = [*(bool(row["is_reached"]) for row in states), *(row["taken"] > 0 for row in transitions)]
        percent = 100.0 * done.count(True) / len(done) if done else 100.0
        return {"percent": percent, "states": states, "transitions": transitions}

    def _row(self, path: str, state: str, arrow: Transition) -> dict[str, Any]:
        evaluated, taken, was_false = self.counts.get((path, state, arrow.name, arrow.place.line), [0, 0, 0])
        return {
            "machine": path, "state": state, "transition": arrow.name, "line": arrow.place.line,
            "evaluated": evaluated, "taken": taken, "was_false": was_false,
        }  # fmt: skip

    def _with_initial(self, program: Program) -> set[tuple[str, str]]:
        """Return the states that were reached, with those in which a machine began inside a state that was."""
        reached = set(self.states)
        for path, spawn in program.walk():  # outer ones first
            around, _, _ = path.rpartition("/")
            machine, _, state = around.rpartition("/")
            if not around or (machine, state) in reached:
                reached.add((path, spawn.initial))
        return reached


def _arrows(machine: MachineDef) -> Iterator[tuple[str, Transition]]:
    """Yield each transition with each state that it can leave."""
    for state in machine.states:
        for one in machine.transitions_of(state.name):
            yield state.name, one
