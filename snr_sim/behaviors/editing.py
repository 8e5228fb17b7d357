"""What an edit of its program means for a running machine: which machine, state and variable is which.

Identity: a machine by its path, a state by its name in its machine, a variable by its path. A state whose name alone
has changed keeps its identity: one state of the machine has gone, one is new, and both have the same clauses.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import msgspec

from snr_sim.behaviors.bound import BoundMachine, BoundProgram
from snr_sim.behaviors.program import Block, MachineDef, StateDef, Transition


class Edited(msgspec.Struct):
    """What an edit did.

    Args:
        kept: paths of machines that continue in their state.
        restarted: of those whose state has gone; they are in the initial one.
        stopped: of those that have gone.
        notes: what may surprise.
    """

    kept: list[str] = []
    restarted: list[str] = []
    stopped: list[str] = []
    notes: list[str] = []


@dataclass
class Plan:
    """How each running machine continues.

    Args:
        kept: old and new machine, and the name of the state that the new one is in.
        restarted: old and new machine, and the initial state.
        stopped: machines that have gone.
    """

    kept: list[tuple[BoundMachine, BoundMachine, str]] = field(default_factory=list)
    restarted: list[tuple[BoundMachine, BoundMachine, str]] = field(default_factory=list)
    stopped: list[BoundMachine] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def plan(running: list[BoundMachine], new: BoundProgram) -> Plan:
    """Return how the machines that run at the top, and those inside them, continue."""
    made = Plan()
    initials = {machine.path: initial for machine, initial in new.top}
    for old in running:
        other = new.machines.get(old.path) if old.path in initials else None
        _plan(old, other, initials.get(old.path, ""), made)
    return made


def _plan(old: BoundMachine, new: BoundMachine | None, initial: str, made: Plan) -> None:
    if new is None:
        made.stopped.append(old)
        return
    assert old.state is not None
    name = same_state(old.definition, new.definition, old.state.name)
    if name is None:
        made.restarted.append((old, new, initial))
        made.notes.append(f"State '{old.state.name}' of '{old.path}' has gone: it begins in '{initial}'.")
        return
    made.kept.append((old, new, name))
    before = f"{old.path}/{old.state.name}/"
    spawned = {one[0].path: one for _, one in new.states[name].enter if one is not None}
    for inner in old.running:
        path = f"{new.path}/{name}/{inner.path.removeprefix(before)}"
        machine, first = spawned.pop(path, (None, ""))
        _plan(inner, machine, first, made)
    made.notes += [f"'{path}' is spawned at the next entry of '{name}'." for path in spawned]


def same_state(old: MachineDef, new: MachineDef, name: str) -> str | None:
    """Return the name in a new definition of a state of the old one; None if it has gone."""
    names = [one.name for one in new.states]
    if name in names:
        return name
    gone = [one for one in old.states if one.name not in names]
    come = [one for one in new.states if one.name not in [other.name for other in old.states]]
    if len(gone) == len(come) == 1 and _content(old, gone[0]) == _content(new, come[0]):
        return come[0].name
    return None


def _content(machine: MachineDef, state: StateDef) -> object:
    """Return what a state says, and the transitions of its machine, with the state's own name left out."""
    ends = [["" if end == state.name else end for end in (one.source, one.target)] for one in machine.transitions]
    return clauses_of(state), ends, [cause_of(one) for one in machine.transitions]


def clauses_of(state: StateDef) -> dict[str, list[object]]:
    """Return what a state does, by the words of LRP."""
    rows = {"onentry": state.enter, "running": state.during, "onexit": state.leave}
    return {
        name: [code_of(one) if isinstance(one, Block) else (one.machine.name, one.initial) for one in blocks]
        for name, blocks in rows.items()
    }


def cause_of(one: Transition) -> tuple[object, ...]:
    """Return what a transition says but for its states and its name."""
    after = code_of(one.after_ns) if isinstance(one.after_ns, Block) else one.after_ns
    return one.kind, one.signal, code_of(one.condition), after, code_of(one.effect)


def code_of(block: Block | None) -> str:
    """Return what a block means, with the helpers that it calls; of a function in Python, its name."""
    return "" if block is None else block.code


def values_after(old: BoundProgram, new: BoundProgram, renamed: dict[str, str]) -> list[str]:
    """Give the variables of a new program their values; return notes.

    A variable keeps its value, unless it is new or its initial value has changed in the text.

    Args:
        old: of which the values are.
        new: its slots are written.
        renamed: new beginnings of paths by the old ones, which end with '/'.
    """
    notes, longest_first = [], sorted(renamed, key=len, reverse=True)
    for path, place in old.places.items():
        begin = next((one for one in longest_first if path.startswith(one)), "")
        now = renamed.get(begin, "") + path[len(begin) :]
        if now not in new.places:
            continue
        first, value = old.first_values[path], old.slots[place]
        if (type(first), first) == (type(new.first_values[now]), new.first_values[now]):
            new.slots[new.places[now]] = value
        elif (type(first), first) != (type(value), value):
            notes.append(f"'{now}' was {value!r:.80}, and begins with its new initial value.")
    return notes


def parts_of(program: BoundProgram) -> dict[str, set[str]]:
    """Return the parts of the robot that the blocks of each machine command, by path."""
    found: dict[str, set[str]] = {}
    for path, machine in program.machines.items():
        blocks = [one for state in machine.definition.states for one in (*state.enter, *state.during, *state.leave)]
        found[path] = {part for one in blocks if isinstance(one, Block) for part in one.drives}
    return found
